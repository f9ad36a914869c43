#include "pipeline/report/label_sheet.h"

#include <fmt/format.h>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "loaders/pictures/encode.h"
#include "loaders/pictures/image.h"
#include "manifests/atomic_file.h"
#include "pipeline/report/lettering.h"

namespace q3d::pipeline::report {
namespace {

using manifests::SampleRecord;

constexpr int kTilePx = 560;  // side of a tile
constexpr int kGapPx = 6;     // between tiles
constexpr int kLegendPx = 30;
constexpr int kCaptionPx = 24;
constexpr int kColumns = 3;
constexpr int kDotPx = 5;
constexpr double kMargin = 0.25;  // of the box's longer side, shown around it
constexpr TextSize kText = TextSize::small;
const cv::Scalar kPaper(24, 24, 24);

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

// Returns where a part of this length begins. It is centred at `centre`, but stays inside the whole if
// possible.
double start_of(double centre, double part, double whole) {
  return part >= whole ? (whole - part) / 2.0 : std::clamp(centre - part / 2.0, 0.0, whole - part);
}

View view_of(const manifests::Box& box, cv::Size picture) {
  const double side = std::max({box.w_px, box.h_px, 1.0}) * (1.0 + 2.0 * kMargin);
  return {start_of(box.x_px + box.w_px / 2.0, side, picture.width),
          start_of(box.y_px + box.h_px / 2.0, side, picture.height), kTilePx / side};
}

cv::Mat decoded_picture(const SampleRecord& record) {
  loaders::pictures::DecodedImage decoded = loaders::pictures::decode_image(record.image_path);
  if (decoded.failure == manifests::Reason::none) return std::move(decoded.rgb);
  throw std::runtime_error(fmt::format("{}: {}", record.image_path, decoded.detail));
}

cv::Mat tile_of(const cv::Mat& picture, const View& view) {
  const cv::Point2d origin = view.to_tile(0.0, 0.0);
  const cv::Matx23d tile_from_image(view.tile_px_per_px, 0.0, origin.x, 0.0, view.tile_px_per_px, origin.y);
  cv::Mat tile;
  cv::warpAffine(picture, tile, tile_from_image, {kTilePx, kTilePx}, cv::INTER_LINEAR, cv::BORDER_CONSTANT,
                 kPaper);
  return tile;
}

const cv::Scalar& colour_of(std::string_view keypoint) {
  if (keypoint.starts_with("left_")) return colours::kBlue;
  return keypoint.starts_with("right_") ? colours::kOrange : colours::kWhite;
}

// A keypoint on its tile, with the user's name for it.
struct Mark {
  cv::Point place;
  std::string name;
  cv::Scalar colour;
};

std::vector<Mark> marks_of(const SampleRecord& record, const View& view,
                           const loaders::keypoints::Topology& topology) {
  const std::vector<std::string>& names = loaders::keypoints::topology("animal3d26").keypoints;
  std::vector<Mark> marks;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const manifests::Keypoint& point = record.keypoints[k];
    if (!(point.weight > 0.0F) || topology.source[k] < 0) continue;
    marks.push_back({view.to_tile(point.x_px, point.y_px),
                     topology.keypoints[static_cast<std::size_t>(topology.source[k])], colour_of(names[k])});
  }
  return marks;
}

// Returns a place for a text near a dot that covers no dot and no other text: beside the dot if there is
// room, else on growing rings around it. If there is no free place, the first one is used.
cv::Rect free_place(cv::Point dot, cv::Size size, const std::vector<cv::Rect>& taken) {
  const cv::Rect tile(0, 0, kTilePx, kTilePx);
  constexpr int kReachPx = kDotPx + 3;
  const auto is_free = [&](const cv::Rect& room) {
    return (room & tile) == room && std::none_of(taken.begin(), taken.end(), [&](const cv::Rect& other) {
             return (other & room).area() > 0;
           });
  };
  const cv::Rect beside(dot.x + kReachPx, dot.y - size.height / 2, size.width, size.height);
  constexpr int kFarthestPx = 120;
  for (int ring = 0; ring <= kFarthestPx; ring += 6) {
    const int right = dot.x + kReachPx + ring;
    const int left = dot.x - kReachPx - ring - size.width;
    const int above = dot.y - kReachPx - ring - size.height;
    const int below = dot.y + kReachPx + ring;
    for (const cv::Point corner :
         {cv::Point(right, beside.y), cv::Point(left, beside.y), cv::Point(dot.x - size.width / 2, below),
          cv::Point(dot.x - size.width / 2, above), cv::Point(right, below), cv::Point(right, above),
          cv::Point(left, below), cv::Point(left, above)}) {
      const cv::Rect room(corner, size);
      if (is_free(room)) return room;
    }
  }
  return beside;
}

// Connects a text with its dot if the text is not beside it.
void draw_leader(cv::Mat& tile, const Mark& mark, const cv::Rect& room) {
  const cv::Point end(std::clamp(mark.place.x, room.x, room.x + room.width),
                      std::clamp(mark.place.y, room.y, room.y + room.height));
  if (cv::norm(end - mark.place) <= 2.0 * kDotPx) return;
  cv::line(tile, mark.place, end, kPaper, 3, cv::LINE_AA);
  cv::line(tile, mark.place, end, mark.colour, 1, cv::LINE_AA);
}

void draw_keypoints(cv::Mat& tile, const std::vector<Mark>& marks) {
  std::vector<cv::Rect> taken;
  for (const Mark& mark : marks) {
    taken.emplace_back(mark.place - cv::Point(kDotPx, kDotPx), cv::Size(2 * kDotPx + 1, 2 * kDotPx + 1));
  }
  std::vector<cv::Rect> rooms;
  for (const Mark& mark : marks) {
    rooms.push_back(free_place(mark.place, {text_width_px(mark.name, kText), line_height_px(kText)}, taken));
    taken.push_back(rooms.back());
  }
  for (std::size_t i = 0; i < marks.size(); ++i) draw_leader(tile, marks[i], rooms[i]);
  for (const Mark& mark : marks) {
    cv::circle(tile, mark.place, kDotPx, kPaper, cv::FILLED, cv::LINE_AA);
    cv::circle(tile, mark.place, kDotPx - 1, mark.colour, cv::FILLED, cv::LINE_AA);
  }
  for (std::size_t i = 0; i < marks.size(); ++i) {
    write_on_photo(tile, marks[i].name, rooms[i].tl(), kText, marks[i].colour);
  }
}

void draw_legend(cv::Mat& sheet) {
  int x = kGapPx;
  for (const auto& [text, colour] :
       {std::pair{"the animal's own left", colours::kBlue},
        std::pair{"the animal's own right", colours::kOrange}, std::pair{"neither", colours::kWhite}}) {
    cv::circle(sheet, {x + kDotPx, kLegendPx / 2}, kDotPx, colour, cv::FILLED, cv::LINE_AA);
    write(sheet, text, {x + 3 * kDotPx, (kLegendPx - line_height_px(kText)) / 2}, kText, colour);
    x += 3 * kDotPx + text_width_px(text, kText) + 24;
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
  constexpr int kStepPx = kTilePx + kGapPx;
  cv::Mat sheet(kLegendPx + down * (kStepPx + kCaptionPx), across * kStepPx + kGapPx, CV_8UC3, kPaper);
  draw_legend(sheet);
  for (std::size_t i = 0; i < records.size(); ++i) {
    const cv::Mat picture = decoded_picture(records[i]);
    const View view = view_of(records[i].box, picture.size());
    cv::Mat tile = tile_of(picture, view);
    draw_keypoints(tile, marks_of(records[i], view, topology));
    const int x = kGapPx + static_cast<int>(i) % across * kStepPx;
    const int y = kLegendPx + static_cast<int>(i) / across * (kStepPx + kCaptionPx);
    tile.copyTo(sheet(cv::Rect(x, y, kTilePx, kTilePx)));
    write(sheet, shortened(records[i].image_ref), {x, y + kTilePx + 3}, kText, colours::kWhite);
  }
  const std::vector<std::byte> png = loaders::pictures::encode_png(sheet);
  manifests::write_file_atomically(path, {reinterpret_cast<const char*>(png.data()), png.size()});
}

}  // namespace q3d::pipeline::report
