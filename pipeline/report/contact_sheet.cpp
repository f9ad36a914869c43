#include "pipeline/report/contact_sheet.h"

#include <fmt/format.h>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "loaders/pictures/crop.h"
#include "loaders/pictures/encode.h"
#include "loaders/pictures/stored_crop.h"
#include "manifests/atomic_file.h"
#include "pipeline/unit/annotated_body.h"
#include "pipeline/unit/crop_keypoints.h"

namespace q3d::pipeline::report {
namespace {

constexpr int kTilePx = loaders::pictures::kPatchSidePx;
constexpr int kCaptionPx = 34;
const cv::Scalar kAnnotated(60, 220, 60);
const cv::Scalar kProjected(255, 60, 60);
const cv::Scalar kPaper(24, 24, 24);
const cv::Scalar kInk(235, 235, 235);

// The network's crop, cut out of the stored crop.
cv::Mat network_crop(const manifests::ShardSample& sample) {
  const cv::Mat stored = loaders::pictures::decode_stored(sample.crop, 3);
  const auto& [center_x, center_y, side] = sample.patch_box;
  const loaders::pictures::Affine from_image =
      loaders::pictures::patch_from_image({center_x, center_y, side}, kTilePx);
  return loaders::pictures::warp_patch(
             stored, {}, loaders::pictures::patch_from_stored_crop(from_image, sample.crop_from_image))
      .rgb;
}

cv::Point to_tile(float x, float y) {
  return {cvRound((x + 0.5) * kTilePx), cvRound((y + 0.5) * kTilePx)};
}

void draw_keypoints(cv::Mat& tile, const manifests::ShardSample& sample) {
  const device::CropKeypoints annotated = unit::crop_keypoints(sample.record);
  const bool has_body = unit::has_projection(sample.projected_2d);
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    const cv::Point point = to_tile(annotated[k].x, annotated[k].y);
    const bool visible = annotated[k].is_visible();
    if (visible) cv::circle(tile, point, 3, kAnnotated, cv::FILLED, cv::LINE_AA);
    if (!has_body) continue;
    const cv::Point projected = to_tile(sample.projected_2d[k].x, sample.projected_2d[k].y);
    if (visible) cv::line(tile, point, projected, kProjected, 1, cv::LINE_AA);
    cv::drawMarker(tile, projected, kProjected, cv::MARKER_TILTED_CROSS, 6, 1, cv::LINE_AA);
  }
}

void draw_caption(cv::Mat& cell, const manifests::ShardSample& sample) {
  const auto write = [&](const std::string& text, int line) {
    cv::putText(cell, text, {4, kTilePx + 13 + 15 * line}, cv::FONT_HERSHEY_SIMPLEX, 0.38, kInk, 1,
                cv::LINE_AA);
  };
  const std::string& id = sample.record.id;
  write(id.size() <= 40 ? id : "..." + id.substr(id.size() - 37), 0);
  const manifests::Judgement& judgement = sample.judgement;
  std::string label(manifests::to_string(sample.label_kind));
  if (!std::isnan(judgement.initial_error)) {
    label += fmt::format("  L {:.3f} -> {:.3f}", judgement.initial_error, judgement.final_error);
  } else if (!std::isnan(judgement.final_error)) {
    label += fmt::format("  L {:.3f}", judgement.final_error);
  }
  write(label, 1);
}

}  // namespace

void write_contact_sheet(const std::filesystem::path& path,
                         const std::vector<manifests::ShardSample>& samples, int columns) {
  std::vector<const manifests::ShardSample*> drawn;
  for (const auto& sample : samples) {
    if (!sample.crop.empty()) drawn.push_back(&sample);
  }
  if (drawn.empty()) {
    throw std::runtime_error(
        "there is no picture to draw: the shards hold no samples, or refer to images only");
  }
  const int across = std::min(columns, static_cast<int>(drawn.size()));
  const int down = (static_cast<int>(drawn.size()) + across - 1) / across;
  cv::Mat sheet(down * (kTilePx + kCaptionPx), across * kTilePx, CV_8UC3, kPaper);
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const int column = static_cast<int>(i) % across;
    const int row = static_cast<int>(i) / across;
    cv::Mat cell =
        sheet(cv::Rect(column * kTilePx, row * (kTilePx + kCaptionPx), kTilePx, kTilePx + kCaptionPx));
    cv::Mat tile = cell(cv::Rect(0, 0, kTilePx, kTilePx));
    network_crop(*drawn[i]).copyTo(tile);
    draw_keypoints(tile, *drawn[i]);
    draw_caption(cell, *drawn[i]);
  }
  const std::vector<std::byte> png = loaders::pictures::encode_png(sheet);
  manifests::write_file_atomically(path, {reinterpret_cast<const char*>(png.data()), png.size()});
}

}  // namespace q3d::pipeline::report
