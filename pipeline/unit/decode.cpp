#include "pipeline/unit/decode.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "loaders/pictures/box.h"
#include "loaders/pictures/crop.h"
#include "loaders/pictures/image.h"
#include "loaders/pictures/orientation.h"
#include "loaders/pictures/stored_crop.h"
#include "pipeline/candidates/digested_file.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::Reason;

// Returns the area of a mask, which is the sum of the warped mask / 255 as in the official evaluator.
double area_px(const cv::Mat& mask) {
  return cv::sum(mask)[0] / 255.0;
}

// Fits a mask to the picture. A mask of the stored pixels' size is turned like the picture, and one of the
// size before resizing is scaled. A mask of the picture's own size is returned unchanged, and so is one that
// fits neither.
cv::Mat fitted_mask(const cv::Mat& mask, const manifests::SampleRecord& record, const cv::Size& size) {
  if (mask.empty() || mask.size() == size) return mask;
  const bool lies_on_its_side = loaders::pictures::exchanges_sides(record.orientation) &&
                                mask.cols * size.width == mask.rows * size.height;
  const cv::Mat upright = lies_on_its_side ? loaders::pictures::turned(mask, record.orientation) : mask;
  if (upright.size() == size || record.scale == 1.0) return upright;
  const bool has_old_size = std::abs(upright.cols * record.scale - size.width) <= 1.0 &&
                            std::abs(upright.rows * record.scale - size.height) <= 1.0;
  if (!has_old_size) return upright;
  cv::Mat scaled;
  cv::resize(upright, scaled, size, 0, 0, record.scale < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  return scaled;
}

// Appends how the picture or its labels were changed, so that a label can be traced back.
void add_provenance(const manifests::SampleRecord& record, std::string& detail) {
  const auto add = [&](const std::string& text) { detail += (detail.empty() ? "" : "; ") + text; };
  if (record.orientation != 1) {
    add(fmt::format("the picture is turned by its EXIF orientation, {}", record.orientation));
  }
  if (record.scale != 1.0) add(fmt::format("box and keypoints are scaled by {:.6g}", record.scale));
}

struct DecodedFiles {
  loaders::pictures::DecodedImage image;
  loaders::pictures::DecodedMask mask;  // absent if the picture failed
};

// Decodes a candidate's files, which must be those that were digested, if any were.
DecodedFiles decode_files(const candidates::Candidate& candidate) {
  const manifests::SampleRecord& record = candidate.record;
  const auto require_same = [&](const std::string& path, const auto& decoded, const std::string& expected) {
    if (candidate.image_sha256.empty()) return;
    candidates::require_as_digested({path, decoded.sha256, decoded.failure, decoded.detail}, expected);
  };
  DecodedFiles files;
  files.image = loaders::pictures::decode_image(record.image_path);
  require_same(record.image_path, files.image, candidate.image_sha256);
  if (files.image.failure != Reason::none) return files;
  files.mask = loaders::pictures::decode_mask(record.mask_path);
  require_same(record.mask_path, files.mask, candidate.mask_sha256);
  return files;
}

}  // namespace

DecodedSample decode_sample(const candidates::Candidate& candidate, Wanted want,
                            const config::ShardConfig& shards) {
  const manifests::SampleRecord& record = candidate.record;
  auto [image, mask] = decode_files(candidate);
  DecodedSample sample;
  if (image.failure != Reason::none) {
    sample.failure = image.failure;
    sample.detail = image.detail;
    return sample;
  }
  image.rgb = loaders::pictures::turned(image.rgb, record.orientation);
  // A mask that is absent, unreadable or no silhouette is dropped. If a file is named, the detail says what
  // is wrong with it.
  mask.silhouette = fitted_mask(mask.silhouette, record, image.rgb.size());
  const bool has_mask = mask.silhouette.size() == image.rgb.size();
  if (!has_mask && mask.kind != loaders::pictures::MaskKind::absent) {
    sample.detail =
        "the mask is left out: " + (mask.detail.empty() ? "it is not of the picture's size" : mask.detail);
  }
  add_provenance(record, sample.detail);
  sample.image_width_px = image.rgb.cols;
  sample.image_height_px = image.rgb.rows;
  sample.has_mask = has_mask;
  if (const auto problem = loaders::pictures::find_box_problem(record.box, image.rgb.cols, image.rgb.rows)) {
    sample.failure = problem->reason;
    sample.detail = fmt::format("got {}, expected {}", problem->got, problem->expected);
    return sample;
  }
  const loaders::pictures::SquareBox square = loaders::pictures::square_box(record.box);
  if (want.patch || want.patch_mask) {
    const bool warps_mask = (want.mask_area || want.patch_mask) && has_mask;
    const loaders::pictures::Patch patch =
        loaders::pictures::make_patch(image.rgb, warps_mask ? mask.silhouette : cv::Mat(), square);
    sample.patch.assign(patch.rgb.datastart, patch.rgb.dataend);
    if (patch.has_mask) sample.mask_area_px = area_px(patch.mask);
    if (want.patch_mask && patch.has_mask) {
      sample.patch_mask.assign(patch.mask.datastart, patch.mask.dataend);
    }
  }
  if (want.stored_crop) {
    sample.stored_crop =
        loaders::pictures::make_stored_crop(image.rgb, has_mask ? mask.silhouette : cv::Mat(), square,
                                            shards.crop_scale, shards.crop_min_side_px);
  }
  return sample;
}

double mask_area_px(const std::string& mask_path, const manifests::Box& box, int image_width_px,
                    int image_height_px) {
  const loaders::pictures::DecodedMask mask = loaders::pictures::decode_mask(mask_path);
  if (mask.silhouette.empty() || mask.silhouette.size() != cv::Size(image_width_px, image_height_px))
    return 0.0;
  const cv::Mat blank = cv::Mat::zeros(mask.silhouette.size(), CV_8UC3);
  const loaders::pictures::Patch patch =
      loaders::pictures::make_patch(blank, mask.silhouette, loaders::pictures::square_box(box));
  return patch.has_mask ? area_px(patch.mask) : 0.0;
}

void decode_unit(UnitWork& work, const config::ShardConfig& shards, const config::JudgingRules* rules) {
  work.decoded.assign(work.candidates.size(), {});
  tbb::parallel_for(std::size_t{0}, work.candidates.size(), [&](std::size_t i) {
    if (run::interrupted()) return;
    if (const auto want = wanted(picture_facts(work, i, rules))) {
      work.decoded[i] = decode_sample(work.candidates[i], *want, shards);
    }
  });
}

void free_unneeded_crops(UnitWork& work, const config::JudgingRules& rules) {
  for (std::size_t i = 0; i < work.decoded.size(); ++i) {
    if (!work.decoded[i].stored_crop) continue;
    const auto want = wanted(picture_facts(work, i, &rules));
    if (!want || !want->stored_crop) work.decoded[i].stored_crop.reset();
  }
}

}  // namespace q3d::pipeline::unit
