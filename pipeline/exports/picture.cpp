#include "pipeline/exports/picture.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "loaders/pictures/crop.h"
#include "loaders/pictures/encode.h"

namespace q3d::pipeline::exports {
namespace {

namespace pictures = loaders::pictures;

constexpr int kJpegQuality = 95;
constexpr double kNearlyWhole = 1e-9;  // px

// Returns what to add to the crop's pixels so that the centre of the network's crop lies on whole pixels.
pictures::Point shift_to_whole(const manifests::ShardSample& sample) {
  const pictures::Point centre =
      pictures::map_point(sample.crop_from_image, {sample.patch_box[0], sample.patch_box[1]});
  const auto missing = [](double at) {
    const double shift = std::round(at) - at;
    return std::abs(shift) < kNearlyWhole ? 0.0 : shift;
  };
  return {missing(centre.x), missing(centre.y)};
}

cv::Mat shifted(const cv::Mat& picture, pictures::Point shift) {
  const cv::Matx23d matrix(1.0, 0.0, shift.x, 0.0, 1.0, shift.y);
  cv::Mat moved;
  cv::warpAffine(picture, moved, matrix, picture.size(), cv::INTER_LANCZOS4, cv::BORDER_CONSTANT);
  return moved;
}

std::vector<std::byte> encoded(const cv::Mat& picture, manifests::ImageEncoding image_encoding) {
  return image_encoding == manifests::ImageEncoding::jpeg ? pictures::encode_jpeg(picture, kJpegQuality)
                                                          : pictures::encode_png(picture);
}

}  // namespace

ExportedPicture export_picture(const manifests::ShardSample& sample, manifests::ImageEncoding image_encoding,
                               Pictures wanted) {
  if (wanted == Pictures::none) {
    return {{}, {}, sample.image_width_px, sample.image_height_px, {1.0, 0.0, 0.0, 0.0, 1.0, 0.0}};
  }
  ExportedPicture picture{sample.crop, sample.crop_mask, sample.crop_side_px, sample.crop_side_px,
                          sample.crop_from_image};
  const pictures::Point shift = wanted == Pictures::official ? shift_to_whole(sample) : pictures::Point{};
  if (shift.x == 0.0 && shift.y == 0.0) return picture;
  try {
    picture.bytes = encoded(shifted(pictures::decode_stored(sample.crop, 3), shift), image_encoding);
    if (!sample.crop_mask.empty()) {
      picture.mask = pictures::encode_png(shifted(pictures::decode_stored(sample.crop_mask, 1), shift));
    }
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("sample {}: {}", sample.record.id, error.what()));
  }
  picture.from_image[2] += shift.x;
  picture.from_image[5] += shift.y;
  return picture;
}

manifests::Box exported_box(const manifests::ShardSample& sample, const ExportedPicture& picture) {
  const manifests::Box& box = sample.record.box;
  const double factor = picture.from_image[0];
  const pictures::Point corner = pictures::map_point(picture.from_image, {box.x_px, box.y_px});
  manifests::Box mapped{corner.x, corner.y, box.w_px * factor, box.h_px * factor};
  // Rounding may move a centre that lies on a whole pixel to just below it, and flooring would then take the
  // previous pixel.
  const pictures::Point centre =
      pictures::map_point(picture.from_image, {sample.patch_box[0], sample.patch_box[1]});
  const auto reach = [](double& start, double extent, double whole) {
    while (std::floor((2.0 * start + extent) / 2.0) < whole) {
      start = std::nextafter(start, std::numeric_limits<double>::infinity());
    }
  };
  if (std::abs(centre.x - std::round(centre.x)) < kNearlyWhole) {
    reach(mapped.x_px, mapped.w_px, std::round(centre.x));
  }
  if (std::abs(centre.y - std::round(centre.y)) < kNearlyWhole) {
    reach(mapped.y_px, mapped.h_px, std::round(centre.y));
  }
  return mapped;
}

std::string picture_stem(const manifests::ShardSample& sample, std::int64_t unit, std::int64_t row) {
  constexpr std::size_t kMaxSpeciesBytes = 100;  // a file's name may have 255
  std::string species = sample.record.species.empty() ? "animal" : sample.record.species;
  if (species.size() > kMaxSpeciesBytes) species.resize(kMaxSpeciesBytes);
  for (char& c : species) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
    if (!is_plain) c = c == ' ' ? '+' : '-';
  }
  return fmt::format("{}_{:06}_{:06}", species, unit, row);
}

}  // namespace q3d::pipeline::exports
