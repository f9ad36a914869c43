#include "pipeline/report/keypoint_painter.h"

#include <fmt/format.h>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include "loaders/keypoints/topology.h"
#include "pipeline/report/lettering.h"

namespace q3d::pipeline::report {
namespace {

constexpr int kFractionBits = 4;  // OpenCV draws between pixels in fixed point

// Numbers of docs/body.md: the spine, so that the rest lies over it, then the limbs, the head and the tail.
constexpr std::array<Bone, 26> kBones{{
    {18, 7, Side::middle}, {18, 12, Side::left},   {12, 8, Side::left},   {8, 14, Side::left},
    {14, 3, Side::left},   {7, 10, Side::left},    {10, 16, Side::left},  {16, 5, Side::left},
    {18, 20, Side::left},  {20, 0, Side::left},    {0, 24, Side::left},   {22, 24, Side::left},
    {18, 13, Side::right}, {13, 9, Side::right},   {9, 15, Side::right},  {15, 4, Side::right},
    {7, 11, Side::right},  {11, 17, Side::right},  {17, 6, Side::right},  {18, 21, Side::right},
    {21, 1, Side::right},  {1, 24, Side::right},   {23, 24, Side::right}, {24, 2, Side::middle},
    {7, 25, Side::middle}, {25, 19, Side::middle},
}};

cv::Point fixed(cv::Point2d point) {
  constexpr double kOne = 1 << kFractionBits;
  return {cvRound(point.x * kOne), cvRound(point.y * kOne)};
}

bool is_drawable(cv::Point2d point) {
  return std::abs(point.x) < 1e5 && std::abs(point.y) < 1e5;  // false for NaN too
}

// Draws a line with a dark rim, so that it is visible on any background.
void draw_line(cv::Mat& tile, cv::Point2d from, cv::Point2d to, const cv::Scalar& colour, int width) {
  if (!is_drawable(from) || !is_drawable(to)) return;
  cv::line(tile, fixed(from), fixed(to), colours::kInk, width + 2, cv::LINE_AA, kFractionBits);
  cv::line(tile, fixed(from), fixed(to), colour, width, cv::LINE_AA, kFractionBits);
}

void draw_disc(cv::Mat& tile, cv::Point2d at, const cv::Scalar& colour) {
  if (!is_drawable(at)) return;
  cv::circle(tile, fixed(at), 4 << kFractionBits, colours::kInk, cv::FILLED, cv::LINE_AA, kFractionBits);
  cv::circle(tile, fixed(at), 3 << kFractionBits, colour, cv::FILLED, cv::LINE_AA, kFractionBits);
}

void draw_cross(cv::Mat& tile, cv::Point2d at) {
  constexpr double kArm = 3.5;
  draw_line(tile, {at.x - kArm, at.y - kArm}, {at.x + kArm, at.y + kArm}, colours::kYellow, 1);
  draw_line(tile, {at.x - kArm, at.y + kArm}, {at.x + kArm, at.y - kArm}, colours::kYellow, 1);
}

Side side_of(const std::string& name) {
  if (name.starts_with("left_")) return Side::left;
  return name.starts_with("right_") ? Side::right : Side::middle;
}

struct KeypointError {
  std::size_t keypoint = 0;
  double error = 0.0;  // (|dx| + |dy|) / 2, as in L_proj
};

void name_errors(cv::Mat& tile, std::span<const KeypointError> errors, std::span<const cv::Point2d> places) {
  const std::vector<std::string>& names = loaders::keypoints::topology("animal3d26").keypoints;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const std::string text = fmt::format("{} {:.1f}", names[errors[i].keypoint], 100.0 * errors[i].error);
    const cv::Point2d at = places[errors[i].keypoint];
    if (!is_drawable(at)) continue;
    const int x =
        std::clamp(cvRound(at.x) + 7, 2, std::max(2, tile.cols - text_width_px(text, TextSize::small) - 2));
    const int y = std::clamp(cvRound(at.y) - 7, 2, tile.rows - line_height_px(TextSize::small));
    write_on_photo(tile, text, {x, y}, TextSize::small);
  }
}

}  // namespace

std::span<const Bone> bones() {
  return kBones;
}

const cv::Scalar& colour_of(Side side) {
  if (side == Side::left) return colours::kBlue;
  return side == Side::right ? colours::kOrange : colours::kWhite;
}

cv::Point2d to_tile(double x, double y, int tile_side_px, double context) {
  return {(x / context + 0.5) * tile_side_px, (y / context + 0.5) * tile_side_px};
}

void draw_keypoints(cv::Mat& tile, const smal::CropKeypoints& annotated, const smal::CropPoints* projected,
                    double context, int named) {
  const std::vector<std::string>& names = loaders::keypoints::topology("animal3d26").keypoints;
  std::array<cv::Point2d, smal::kNumKeypoints> places;
  std::array<bool, smal::kNumKeypoints> visible{};
  for (std::size_t k = 0; k < places.size(); ++k) {
    places[k] = to_tile(annotated[k].x, annotated[k].y, tile.cols, context);
    visible[k] = annotated[k].is_visible();
  }
  for (const Bone& bone : bones()) {
    const auto from = static_cast<std::size_t>(bone.from), to = static_cast<std::size_t>(bone.to);
    if (visible[from] && visible[to]) draw_line(tile, places[from], places[to], colour_of(bone.side), 2);
  }
  for (std::size_t k = 0; k < places.size(); ++k) {
    if (visible[k]) draw_disc(tile, places[k], colour_of(side_of(names[k])));
  }
  if (projected == nullptr) return;
  std::vector<KeypointError> errors;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const double x = (*projected)[k].x, y = (*projected)[k].y;
    const cv::Point2d at = to_tile(x, y, tile.cols, context);
    if (visible[k]) {
      draw_line(tile, places[k], at, colours::kYellow, 1);
      errors.push_back({k, (std::abs(x - annotated[k].x) + std::abs(y - annotated[k].y)) / 2.0});
    }
    draw_cross(tile, at);
  }
  const auto count = std::min(errors.size(), static_cast<std::size_t>(std::max(named, 0)));
  std::partial_sort(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(count), errors.end(),
                    [](const KeypointError& a, const KeypointError& b) { return a.error > b.error; });
  name_errors(tile, std::span(errors).first(count), places);
}

}  // namespace q3d::pipeline::report
