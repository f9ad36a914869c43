// Lists that people write: v vetoes, c corrected keypoints, l curate's list of pictures, w conditions of
// `subset --where`, y a DeepLabCut project's config.yaml.
#include <cmath>

#include "loaders/formats/deeplabcut_files.h"
#include "pipeline/candidates/corrections.h"
#include "pipeline/candidates/curation_list.h"
#include "pipeline/candidates/veto.h"
#include "pipeline/derived/where.h"
#include "pipeline/run/errors.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;
using q3d::fuzz::Scratch;
using q3d::fuzz::value_or_refusal;
using q3d::pipeline::run::ConfigError;
namespace candidates = q3d::pipeline::candidates;

void read_veto(const std::filesystem::path& file) {
  value_or_refusal<ConfigError>(file, [&] {
    for (const auto& [id, why] : candidates::read_veto(file).reasons) {
      require(id.find('#') != id.npos && id.find('\n') == id.npos, "a veto names a sample", id);
      require(!why.empty(), "a veto has a reason", id);
    }
  });
}

void read_corrections(const Scratch& scratch, const std::filesystem::path& file) {
  value_or_refusal<ConfigError>(file, [&] {
    const candidates::Corrections read = candidates::read_corrections(file);
    for (const auto& [id, points] : read.points) {
      for (const auto& point : points) {
        require(point.keypoint < q3d::manifests::kNumKeypoints && std::isfinite(point.x_px) &&
                    std::isfinite(point.y_px) && point.v >= 0 && point.v <= 2,
                "a corrected keypoint is at a place", id);
      }
    }
    // An id that begins with '#' would be a remark.
    for (const auto& each : read.points) {
      if (each.first.starts_with('#')) return;
    }
    const std::string text = candidates::corrections_text(read.points);
    const auto again = candidates::read_corrections(scratch.write("again.tsv", text));
    require(candidates::corrections_text(again.points) == text, "corrections survive being written", text);
  });
}

void read_where(const std::string& text) {
  try {
    const auto condition = q3d::pipeline::derived::parse_where(text);
    const q3d::pipeline::dataset::VerdictRow row;
    condition({row, std::nullopt});
  } catch (const ConfigError& error) {
    require(std::string_view(error.what()).find("--where") != std::string_view::npos,
            "a refusal says of what", error.what());
  }
}

void read_project(const Scratch& scratch, std::string_view yaml) {
  const auto file = scratch.write("project/config.yaml", yaml);
  const auto labels = file.parent_path();
  scratch.write("project/CollectedData_Ada.csv", "");
  scratch.write("project/CollectedData_Bob.csv", "");
  try {
    q3d::loaders::formats::Notes notes;
    const auto files = project_label_files(labels, labels, notes);
    require(files.size() == 1 && files.front().parent_path() == labels, "a project's labels lie in it");
  } catch (const std::runtime_error& error) {
    require(std::string_view(error.what()).find("project") != std::string_view::npos,
            "a refusal names the folder", error.what());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  const q3d::fuzz::Chosen chosen = q3d::fuzz::chosen_reader(data, size);
  const auto& [reader, bytes] = chosen;
  const auto file = [&] { return scratch.write("list.txt", chosen.bytes); };
  if (reader == 'v') read_veto(file());
  if (reader == 'c') read_corrections(scratch, file());
  if (reader == 'l') {
    value_or_refusal<ConfigError>(scratch.write("list.csv", bytes),
                                  [&] { candidates::chosen_pictures(scratch.root() / "list.csv", "train"); });
  }
  if (reader == 'w') read_where(std::string(bytes));
  if (reader == 'y') read_project(scratch, bytes);
  return 0;
}
