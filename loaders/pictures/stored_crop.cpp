#include "loaders/pictures/stored_crop.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace q3d::loaders::pictures {
namespace {

constexpr int kNeighbourMarginPx = 2;

struct Region {  // a square of the image, in whole pixels; it may reach outside
  int left_px = 0;
  int top_px = 0;
  int side_px = 0;
};

Region region_around(const SquareBox& box, double scale) {
  const int side_px = static_cast<int>(std::ceil(box.side_px * scale)) + 2 * kNeighbourMarginPx;
  return {static_cast<int>(std::floor(box.center_x_px - side_px / 2.0)),
          static_cast<int>(std::floor(box.center_y_px - side_px / 2.0)), side_px};
}

cv::Mat copied(const cv::Mat& image, const Region& region) {
  cv::Mat crop(region.side_px, region.side_px, image.type(), cv::Scalar::all(0));
  const cv::Rect wanted(region.left_px, region.top_px, region.side_px, region.side_px);
  const cv::Rect inside = wanted & cv::Rect({0, 0}, image.size());
  if (!inside.empty()) image(inside).copyTo(crop(inside - wanted.tl()));
  return crop;
}

// The source pixels that one target pixel covers along one axis, and how much of each (in source px).
struct Span {
  int first = 0;
  std::vector<float> cover;  // empty where the target pixel lies outside the image
};

std::vector<Span> spans(int start_px, double step, int target_count, int source_count) {
  std::vector<Span> result(static_cast<std::size_t>(target_count));
  for (int i = 0; i < target_count; ++i) {
    const double begin = std::max(start_px + i * step, 0.0);
    const double end = std::min(start_px + (i + 1) * step, static_cast<double>(source_count));
    if (end <= begin) continue;
    Span& span = result[static_cast<std::size_t>(i)];
    span.first = static_cast<int>(begin);
    for (int at = span.first; at < std::min(static_cast<int>(std::ceil(end)), source_count); ++at) {
      span.cover.push_back(static_cast<float>(std::min(end, at + 1.0) - std::max(begin, 1.0 * at)));
    }
  }
  return result;
}

// Adds `weight` times a source row, reduced along x, to `sums`.
void add_row(const std::uint8_t* row, int channels, const std::vector<Span>& columns, float weight,
             std::vector<float>& sums) {
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const Span& span = columns[i];
    for (int c = 0; c < channels; ++c) {
      float sum = 0.0F;
      const std::uint8_t* pixel = row + span.first * channels + c;
      for (const float cover : span.cover) {
        sum += cover * static_cast<float>(*pixel);
        pixel += channels;
      }
      sums[i * static_cast<std::size_t>(channels) + static_cast<std::size_t>(c)] += weight * sum;
    }
  }
}

// Averages the source over the area of each target pixel; pixels outside the image count as black. Unlike
// cv::resize this needs no padded copy of the region, which for a large box could be many times the image.
cv::Mat reduced(const cv::Mat& image, const Region& region, int side_px) {
  const double step = static_cast<double>(region.side_px) / side_px;
  const std::vector<Span> columns = spans(region.left_px, step, side_px, image.cols);
  const std::vector<Span> rows = spans(region.top_px, step, side_px, image.rows);
  const int channels = image.channels();
  const auto per_area = static_cast<float>(1.0 / (step * step));
  cv::Mat crop(side_px, side_px, image.type(), cv::Scalar::all(0));
  std::vector<float> sums(static_cast<std::size_t>(side_px * channels));
  for (int y = 0; y < side_px; ++y) {
    const Span& span = rows[static_cast<std::size_t>(y)];
    std::fill(sums.begin(), sums.end(), 0.0F);
    for (std::size_t k = 0; k < span.cover.size(); ++k) {
      add_row(image.ptr<std::uint8_t>(span.first + static_cast<int>(k)), channels, columns, span.cover[k],
              sums);
    }
    std::transform(sums.begin(), sums.end(), crop.ptr<std::uint8_t>(y),
                   [&](float sum) { return cv::saturate_cast<std::uint8_t>(sum * per_area); });
  }
  return crop;
}

}  // namespace

StoredCrop make_stored_crop(const cv::Mat& rgb, const cv::Mat& mask, const SquareBox& box, double scale,
                            int min_side_px) {
  const bool mask_fits = mask.empty() || (mask.type() == CV_8UC1 && mask.size() == rgb.size());
  if (rgb.type() != CV_8UC3 || rgb.empty() || !mask_fits) {
    throw std::invalid_argument(
        fmt::format("make_stored_crop: got a {}x{} picture of type {} and a {}x{} mask of type {}, expected "
                    "8-bit RGB and an 8-bit grey mask of the same size, or none",
                    rgb.cols, rgb.rows, rgb.type(), mask.cols, mask.rows, mask.type()));
  }
  if (!(scale >= 1.0) || min_side_px < kPatchSidePx) {
    throw std::invalid_argument(
        fmt::format("make_stored_crop: got scale {} and {} px, expected >= 1 and >= {}", scale, min_side_px,
                    kPatchSidePx));
  }
  const Region region = region_around(box, scale);
  const int side_px = std::min(region.side_px, min_side_px);
  const auto cut = [&](const cv::Mat& image) {
    return side_px == region.side_px ? copied(image, region) : reduced(image, region, side_px);
  };
  StoredCrop crop;
  crop.rgb = cut(rgb);
  if (!mask.empty()) crop.mask = cut(mask);
  // Coordinates refer to pixel centres: the corner of pixel x lies at x - 0.5, and corners map to corners.
  const double factor = static_cast<double>(side_px) / region.side_px;
  const auto shift = [&](int start_px) { return (0.5 - start_px) * factor - 0.5; };
  crop.from_image = {factor, 0.0, shift(region.left_px), 0.0, factor, shift(region.top_px)};
  return crop;
}

Affine patch_from_stored_crop(const Affine& patch_from_image, const Affine& crop_from_image) {
  return compose(patch_from_image, invert(crop_from_image));
}

}  // namespace q3d::loaders::pictures
