#include "pipeline/report/overlay_run.h"

#include <fmt/format.h>

#include <cctype>
#include <stdexcept>

#include "loaders/pictures/encode.h"
#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "pipeline/report/body_files.h"
#include "pipeline/run/errors.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::report {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestStem = 150;  // file names have at most 255 bytes

void write_png(const fs::path& path, const cv::Mat& picture) {
  manifests::write_file_atomically(path, std::span<const std::byte>(loaders::pictures::encode_png(picture)));
}

std::string body_kind(const OverlaySubject& subject) {
  if (subject.label) return std::string(manifests::to_string(subject.row.judgement.verdict));
  return subject.dropped ? "adapted, and dropped" : "prediction";
}

class OverlayWriter {
 public:
  OverlayWriter(const OverlayOptions& options, const OverlayPainter& painter)
      : options_(options), painter_(painter) {}

  void add(const OverlaySubject& subject) {
    summary_.ids.push_back(subject.row.id);
    const std::string stem = file_stem(subject.row.id);
    const cv::Mat picture = options_.captions ? painter_.captioned(subject, options_.panels)
                                              : painter_.row(subject, options_.panels);
    if (!options_.folder.empty()) {
      write_png(options_.folder / (stem + ".png"),
                options_.captions ? overlay_sheet({picture}, options_.panels, 1) : picture);
      ++summary_.files;
    }
    if (!options_.sheet.empty()) pictures_.push_back(picture);
    if (options_.obj || options_.glb) write_body(subject, stem);
  }

  OverlaySummary finish() {
    if (!options_.sheet.empty()) {
      write_png(options_.sheet, overlay_sheet(pictures_, options_.panels, options_.columns));
      ++summary_.files;
    }
    return std::move(summary_);
  }

 private:
  void write_body(const OverlaySubject& subject, const std::string& stem) {
    const PosedBodies bodies = painter_.pose(subject);
    if (bodies.shown() == nullptr) {
      summary_.without_body.push_back(subject.row.id);
      return;
    }
    const PhotoBody body{subject.row.id, body_kind(subject), bodies.shown(), subject.box()};
    if (options_.obj) {
      manifests::write_file_atomically(options_.folder / (stem + ".obj"), obj_text(body, painter_.faces()));
      ++summary_.files;
    }
    if (options_.glb) {
      const std::vector<std::byte> bytes = glb_bytes(body, painter_.faces());
      manifests::write_file_atomically(options_.folder / (stem + ".glb"), std::span(bytes));
      ++summary_.files;
    }
  }

  const OverlayOptions& options_;
  const OverlayPainter& painter_;
  std::vector<cv::Mat> pictures_;  // of the sheet
  OverlaySummary summary_;
};

void check(const OverlayOptions& options) {
  if (options.folder.empty() && options.sheet.empty()) {
    throw run::ConfigError("nothing to write: give --out FOLDER, --sheet FILE, or both");
  }
  if (options.folder.empty() && (options.obj || options.glb)) {
    throw run::ConfigError("--obj and --glb write into a folder: give --out FOLDER");
  }
  if (options.panels.empty()) throw run::ConfigError("--panels names no panel");
}

}  // namespace

std::string file_stem(const std::string& id) {
  std::string stem;
  for (const char c : id.substr(id.size() > kLongestStem ? id.size() - kLongestStem : 0)) {
    const auto byte = static_cast<unsigned char>(c);
    stem += std::isalnum(byte) != 0 || c == '.' || c == '-' ? c : '_';
  }
  return stem + "-" + manifests::sha256(id).substr(0, 8);
}

fs::path find_body_model(const dataset::PublishedDataset& dataset, const SourceFiles& files,
                         const fs::path& given) {
  const std::string& sha256 = dataset.manifest().smal_asset_sha256;
  if (auto found = files.body_model(sha256, given)) return *found;
  if (sha256.empty()) {
    throw MissingBodyModel(
        fmt::format("{}: it was built without a network and names no body model; give --body FILE",
                    dataset.version_name()));
  }
  throw MissingBodyModel(
      fmt::format("{}: its body model (SHA-256 {}) is not where the build found it; give --body FILE, or "
                  "--config with the build's config",
                  dataset.version_name(), sha256));
}

OverlaySummary draw_overlays(const OverlayOptions& options, const device::BodyMeshesLoader& load_bodies) {
  check(options);
  const dataset::PublishedDataset dataset(options.dataset);
  const std::vector<dataset::VerdictRow> rows =
      choose(dataset.verdicts(), dataset.manifest().thresholds, options.choice);
  if (rows.empty()) {
    throw std::runtime_error(fmt::format(
        "{}: no candidate passes the filters; `quadruped3d inspect` counts them", dataset.version_name()));
  }
  const SourceFiles files(dataset.output_folder(), options.config ? &*options.config : nullptr);
  const std::unique_ptr<device::BodyMeshes> bodies =
      load_bodies(find_body_model(dataset, files, options.body));
  if (!options.folder.empty()) fs::create_directories(options.folder);
  const OverlayPainter painter(bodies.get());
  OverlayWriter writer(options, painter);
  for (const OverlaySubject& subject : read_subjects(dataset, files, rows)) {
    run::throw_if_interrupted();
    writer.add(subject);
  }
  return writer.finish();
}

}  // namespace q3d::pipeline::report
