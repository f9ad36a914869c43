#include "pipeline/report/label_sheet.h"

#include <fmt/format.h>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>

#include "loaders/pictures/encode.h"
#include "loaders/pictures/image.h"
#include "manifests/atomic_file.h"

namespace q3d::pipeline::report {
namespace {

using manifests::SampleRecord;

constexpr int kTilePx = 560;  // side of a tile
constexpr int kCaptionPx = 40;
constexpr int kColumns = 3;
constexpr double kMargin = 0.25;  // of the box's longer side, shown around it
constexpr double kFontScale = 0.42;
const cv::Scalar kLeft(70, 150, 255);
const cv::Scalar kRight(255, 150, 30);
const cv::Scalar kMiddle(255, 255, 255);
const cv::Scalar kPaper(24, 24, 24);
const cv::Scalar kInk(235, 235, 235);

// A square part of the picture, scaled to a tile.
struct View {
  double x_px;
  double y_px;
  double tile_px_per_px;

  cv::Point2d to_tile(double image_x_px, double image_y_px) const {
    return {(image_x_px - x_px + 0.5) * tile_px_per_px - 0.5,
            (image_y_px - y_px + 0.5) * tile_px_per_px - 0.5};
  }
};

View view_of(const manifests::Box& box) {
  const double side = std::max({box.w_px, box.h_px, 1.0}) * (1.0 + 2.0 * kMargin);
  return {box.x_px + box.w_px / 2.0 - side / 2.0, box.y_px + box.h_px / 2.0 - side / 2.0, kTilePx / side};
}

cv::Mat tile_of(const SampleRecord& record, const View& view) {
  const loaders::pictures::DecodedImage decoded = loaders::pictures::decode_image(record.image_path);
  if (decoded.failure != manifests::Reason::none) {
    throw std::runtime_error(fmt::format("{}: {}", record.image_path, decoded.detail));
  }
  const cv::Point2d origin = view.to_tile(0.0, 0.0);
  const cv::Matx23d tile_from_image(view.tile_px_per_px, 0.0, origin.x, 0.0, view.tile_px_per_px, origin.y);
  cv::Mat tile;
  cv::warpAffine(decoded.rgb, tile, tile_from_image, {kTilePx, kTilePx}, cv::INTER_LINEAR,
                 cv::BORDER_CONSTANT, kPaper);
  return tile;
}

const cv::Scalar& colour_of(std::string_view keypoint) {
  if (keypoint.starts_with("left_")) return kLeft;
  return keypoint.starts_with("right_") ? kRight : kMiddle;
}

// Texts that would cover each other are moved down until they do not.
cv::Point free_place(cv::Point place, cv::Size size, std::vector<cv::Rect>& taken) {
  place.x = std::clamp(place.x, 0, std::max(0, kTilePx - size.width));
  cv::Rect room(place.x, place.y - size.height, size.width, size.height);
  const auto is_taken = [&] {
    return std::any_of(taken.begin(), taken.end(),
                       [&](const cv::Rect& other) { return (other & room).area() > 0; });
  };
  while (is_taken() && room.y + room.height < kTilePx) ++room.y;
  taken.push_back(room);
  return {room.x, room.y + room.height};
}

void write_text(cv::Mat& image, const std::string& text, cv::Point place, const cv::Scalar& colour) {
  cv::putText(image, text, place, cv::FONT_HERSHEY_SIMPLEX, kFontScale, kPaper, 3, cv::LINE_AA);
  cv::putText(image, text, place, cv::FONT_HERSHEY_SIMPLEX, kFontScale, colour, 1, cv::LINE_AA);
}

void draw_keypoints(cv::Mat& tile, const View& view, const SampleRecord& record,
                    const loaders::keypoints::Topology& topology) {
  const std::vector<std::string>& names = loaders::keypoints::topology("animal3d26").keypoints;
  std::vector<cv::Rect> taken;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const manifests::Keypoint& point = record.keypoints[k];
    if (!(point.weight > 0.0F) || topology.source[k] < 0) continue;
    const cv::Point place = view.to_tile(point.x_px, point.y_px);
    const cv::Scalar& colour = colour_of(names[k]);
    cv::circle(tile, place, 5, kPaper, cv::FILLED, cv::LINE_AA);
    cv::circle(tile, place, 4, colour, cv::FILLED, cv::LINE_AA);
    const std::string& text = topology.keypoints[static_cast<std::size_t>(topology.source[k])];
    int baseline = 0;
    const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, kFontScale, 1, &baseline);
    const cv::Size room(size.width, size.height + baseline);
    write_text(tile, text, free_place(place + cv::Point(7, 4), room, taken), colour);
  }
}

std::string shortened(const std::string& text) {
  constexpr std::size_t kMost = 60;
  return text.size() <= kMost ? text : "..." + text.substr(text.size() - kMost + 3);
}

}  // namespace

void write_label_sheet(const std::filesystem::path& path, const std::vector<SampleRecord>& records,
                       const loaders::keypoints::Topology& topology) {
  if (records.empty()) throw std::runtime_error("there is no animal to draw");
  const int across = std::min(kColumns, static_cast<int>(records.size()));
  const int down = (static_cast<int>(records.size()) + across - 1) / across;
  cv::Mat sheet(down * (kTilePx + kCaptionPx), across * kTilePx, CV_8UC3, kPaper);
  for (std::size_t i = 0; i < records.size(); ++i) {
    const View view = view_of(records[i].box);
    cv::Mat tile = tile_of(records[i], view);
    draw_keypoints(tile, view, records[i], topology);
    const int x = static_cast<int>(i) % across * kTilePx;
    const int y = static_cast<int>(i) / across * (kTilePx + kCaptionPx);
    tile.copyTo(sheet(cv::Rect(x, y, kTilePx, kTilePx)));
    write_text(sheet, shortened(records[i].image_ref), {x + 6, y + kTilePx + 16}, kInk);
    write_text(sheet, "the animal's left", {x + 6, y + kTilePx + 33}, kLeft);
    write_text(sheet, "the animal's right", {x + 150, y + kTilePx + 33}, kRight);
  }
  const std::vector<std::byte> png = loaders::pictures::encode_png(sheet);
  manifests::write_file_atomically(path, {reinterpret_cast<const char*>(png.data()), png.size()});
}

}  // namespace q3d::pipeline::report
