// Annotation files in every JSON format, with keypoints or boxes alone, and as the labels of a sub-dataset
// that `curate` asks: the same bytes go to each loader.
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "loaders/curation/source_labels.h"
#include "loaders/formats/dataset.h"
#include "manifests/record_json.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;
using q3d::manifests::Reason;
using q3d::manifests::SampleRecord;

constexpr const char* kTopology = R"({"name": "mine", "keypoints": ["eye_l", "eye_r", "snout"],
  "flip_pairs": [["eye_l", "eye_r"]],
  "animal3d26": {"left_eye": "eye_l", "right_eye": "eye_r", "nose": "snout"}})";

// Checks what every later stage relies on.
void check(const SampleRecord& record, bool has_keypoints, const std::string& root) {
  if (record.failure == Reason::none) {
    const auto& box = record.box;
    require(std::isfinite(box.x_px) && std::isfinite(box.y_px) && box.w_px > 0 && box.h_px > 0 &&
                std::isfinite(box.w_px) && std::isfinite(box.h_px),
            "a usable record has a box with an area", record.id);
    require(record.image_path.starts_with(root), "a usable record has a picture below the root",
            record.image_path);
    bool any = !has_keypoints;
    for (const auto& point : record.keypoints) {
      if (!(point.weight > 0.0F)) continue;
      any = true;
      require(std::isfinite(point.x_px) && std::isfinite(point.y_px) && point.weight <= 1.0F,
              "a labelled keypoint is at a place", record.id);
    }
    require(any, "a usable record has a labelled keypoint", record.id);
  } else {
    require(!record.failure_detail.empty(), "a failure says what was found", record.id);
  }
  // Ingest writes the record as JSON, which refuses texts that are cut within a character.
  SampleRecord back;
  nlohmann::json::parse(nlohmann::json(record).dump()).get_to(back);
  require(record_digest(back) == record_digest(record), "a record survives its own JSON", record.id);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const q3d::fuzz::Scratch scratch;
  static const auto topology = scratch.write("topology.json", kTopology);
  // The formats' own folders, with the pictures that the corpus names. They are looked for, not read.
  static const bool has_pictures = [] {
    for (const char* name : {"a.jpg", "images/a.jpg", "dataset/AAAA/1.jpg", "Images/a.jpg"})
      scratch.write(name, "");
    return true;
  }();
  require(has_pictures, "pictures are there");
  static const std::string root = std::filesystem::canonical(scratch.root()).string() + "/";
  const auto file = scratch.write("train.json", q3d::fuzz::as_text(data, size));
  for (const char* format :
       {"prima", "superanimal", "animal_kingdom", "stanfordextra", "badja", "coco", "photographs"}) {
    q3d::loaders::formats::DatasetOptions options{.name = "set",
                                                  .format = format,
                                                  .split = "train",
                                                  .root = scratch.root(),
                                                  .annotations = "train.json",
                                                  .images = {}};
    if (options.format == "coco") options.topology = topology;
    q3d::fuzz::value_or_refusal(file, [&] {
      std::set<std::string> ids;
      for (const SampleRecord& record : load_dataset(options).records) {
        check(record, options.format != "photographs", root);
        require(ids.insert(record.id).second, "ids are unique", record.id);
      }
    });
  }
  q3d::fuzz::value_or_refusal(file, [&] {
    q3d::loaders::curation::SourceLabels labels;
    labels.add(file);
    labels.find("images/a.jpg");
  });
  return 0;
}
