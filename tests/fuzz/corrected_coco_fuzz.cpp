// A COCO file that comes back from an annotation tool, and the exported file that it is compared with, which
// may be a stranger's too: two files, parted by 0x1E. A sound export stands in for a second file that is not
// there.
#include <cmath>
#include <nlohmann/json.hpp>

#include "manifests/keypoint_names.h"
#include "manifests/sample.h"
#include "pipeline/exports/corrections.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using nlohmann::json;
using q3d::fuzz::require;

std::string sound_export() {
  json names = json::array();
  json keypoints = json::array();
  for (const std::string_view name : q3d::manifests::kKeypointNames) {
    names.push_back(name);
    for (const int number : {10, 20, 2}) keypoints.push_back(number);
  }
  const json about = {{"id", "set/train/a.jpg#0"}, {"picture_from_image", {2, 0, 0, 0, 2, 0}}};
  return json{{"categories", {{{"id", 1}, {"name", "goat"}, {"keypoints", names}}}},
              {"images", {{{"id", 1}, {"file_name", "a.jpg"}, {"quadruped3d", about}}}},
              {"annotations", {{{"id", 1}, {"image_id", 1}, {"category_id", 1}, {"keypoints", keypoints}}}}}
      .dump();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const q3d::fuzz::Scratch scratch;
  static const std::string sound = sound_export();
  const auto [corrected, exported] = q3d::fuzz::two_files(q3d::fuzz::as_text(data, size));
  const auto before = scratch.write("coco/annotations.json", exported.empty() ? sound : exported);
  const auto after = scratch.write("coco/corrected.json", corrected);
  q3d::fuzz::value_or_refusal("json", [&] {
    const auto changes = q3d::pipeline::exports::coco_changes(before.parent_path(), after);
    require(changes.points.size() + changes.vetoes.size() <= changes.pictures, "a picture changes once");
    for (const auto& [id, points] : changes.points) {
      for (const auto& point : points) {
        require(point.keypoint < q3d::manifests::kNumKeypoints && point.v >= 0 && point.v <= 2 &&
                    std::isfinite(point.x_px) && std::isfinite(point.y_px),
                "a corrected keypoint is at a place", id);
      }
    }
    // What is written for the next build is read there.
    write_changes(changes, scratch.root() / "changes");
  });
  return 0;
}
