#include "pipeline/report/contact_sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "loaders/pictures/encode.h"
#include "manifests/atomic_file.h"
#include "pipeline/dataset/inspect.h"
#include "pipeline/report/keypoint_painter.h"
#include "pipeline/report/lettering.h"
#include "pipeline/report/overlay_painter.h"
#include "pipeline/report/overlay_run.h"
#include "pipeline/run/log.h"
#include "pipeline/unit/crop_keypoints.h"

namespace q3d::pipeline::report {
namespace {

namespace fs = std::filesystem;

constexpr int kTilePx = 260;

// Returns the dataset's folder. A shard lies in the folder `shards` of its dataset, unless somebody moved it.
fs::path dataset_of(const fs::path& path) {
  return fs::is_directory(path) ? path : fs::absolute(path).parent_path().parent_path();
}

// Returns null if no body model is found; a note then says why.
std::unique_ptr<device::BodyMeshes> bodies_for(const SheetOptions& options,
                                               const device::BodyMeshesLoader& load_bodies) {
  if (!options.body.empty() && !fs::is_directory(options.path)) return load_bodies(options.body);
  const fs::path folder = dataset_of(options.path);
  try {
    if (!fs::is_directory(options.path) && !fs::exists(folder / "dataset.json")) {
      throw MissingBodyModel("the shard lies in no dataset that names one; give --body FILE");
    }
    const dataset::PublishedDataset dataset(folder);
    const SourceFiles files(dataset.output_folder(), nullptr);
    return load_bodies(find_body_model(dataset, files, options.body));
  } catch (const MissingBodyModel& error) {
    run::log_note(fmt::format("the sheet shows keypoints without meshes: {}", error.what()));
    return nullptr;
  }
}

cv::Mat tile(const OverlaySubject& subject, const OverlayPainter& painter) {
  cv::Mat picture = photo_tile(subject, kTilePx);
  if (const auto label = painter.pose(subject).label) painter.draw_body(picture, *label, colours::kOrange);
  draw_keypoints(picture, unit::crop_keypoints(subject.record),
                 subject.label ? &subject.label->keypoints_2d : nullptr, kPanelContext, 0);
  return picture;
}

std::string error_line(const manifests::ShardSample& sample) {
  const manifests::Judgement& judgement = sample.judgement;
  std::string text(manifests::to_string(sample.label_kind));
  if (std::isfinite(judgement.initial_error)) {
    text += fmt::format("  L_proj {:.3f}", judgement.initial_error);
    if (judgement.iterations > 0) text += fmt::format(" -> {:.3f}", judgement.final_error);
  } else if (std::isfinite(judgement.final_error)) {
    text += fmt::format("  L_proj {:.3f}", judgement.final_error);
  }
  return text;
}

cv::Mat cell(const manifests::ShardSample& sample, const OverlayPainter& painter) {
  const OverlaySubject subject = subject_of(sample);
  std::vector<std::string> lines = wrapped(subject.row.id, kTilePx, TextSize::small);
  lines.push_back(error_line(sample));
  const int step = line_height_px(TextSize::small);
  cv::Mat picture(kTilePx + step * static_cast<int>(lines.size()), kTilePx, CV_8UC3, colours::kPaper);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    write(picture, lines[i], {0, step * static_cast<int>(i)}, TextSize::small);
  }
  tile(subject, painter).copyTo(picture(cv::Rect(0, picture.rows - kTilePx, kTilePx, kTilePx)));
  return picture;
}

}  // namespace

void write_contact_sheet(const SheetOptions& options, const device::BodyMeshesLoader& load_bodies) {
  std::vector<manifests::ShardSample> samples = dataset::spread_samples(options.path, options.count);
  std::erase_if(samples, [](const manifests::ShardSample& sample) { return sample.crop.empty(); });
  if (samples.empty()) {
    throw std::runtime_error(
        "there is no picture to draw: the shards hold no samples, or refer to images only; `quadruped3d "
        "overlay` draws these from the source pictures");
  }
  const std::unique_ptr<device::BodyMeshes> bodies = bodies_for(options, load_bodies);
  const OverlayPainter painter(bodies.get());
  std::vector<cv::Mat> cells;
  for (const manifests::ShardSample& sample : samples) cells.push_back(cell(sample, painter));
  constexpr std::array kShown{Panel::label, Panel::keypoints};
  const std::vector<std::byte> png =
      loaders::pictures::encode_png(overlay_sheet(cells, kShown, options.columns));
  manifests::write_file_atomically(options.out, std::span(png));
}

}  // namespace q3d::pipeline::report
