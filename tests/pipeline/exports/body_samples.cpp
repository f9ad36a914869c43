#include "tests/pipeline/exports/body_samples.h"

#include <opencv2/imgproc.hpp>

#include <random>

#include "filters/metrics.h"
#include "loaders/pictures/crop.h"
#include "loaders/pictures/encode.h"
#include "loaders/pictures/stored_crop.h"
#include "smal/axis_angle.h"
#include "smal/camera.h"
#include "tests/pipeline/feed/sample_shards.h"

namespace q3d::testing {
namespace {

namespace pictures = loaders::pictures;

constexpr int kReducedSidePx = 257;  // odd, and less than the crop's 230 to 308 px

class Uniform {
 public:
  explicit Uniform(unsigned seed) : engine_(seed) {}
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0;
  }

 private:
  std::mt19937 engine_;
};

// Replaces the stored crop by one of the same picture, with an ellipse as its mask, and reduces it.
void store_again(manifests::ShardSample& sample, bool has_mask, Stored stored) {
  const cv::Mat picture = pictures::decode_stored(sample.crop, 3);
  cv::Mat mask;
  if (has_mask) {
    mask = cv::Mat(picture.size(), CV_8UC1, cv::Scalar(0));
    cv::ellipse(mask, {picture.cols / 2, picture.rows / 2}, {70, 50}, 0.0, 0.0, 360.0, cv::Scalar(255), -1);
  }
  const pictures::Point centre =
      pictures::map_point(sample.crop_from_image, {sample.patch_box[0], sample.patch_box[1]});
  const int side_px = stored == Stored::reduced ? kReducedSidePx : 480;
  const pictures::StoredCrop crop = pictures::make_stored_crop(
      picture, mask, {centre.x, centre.y, sample.patch_box[2]}, pictures::kStoredCropScale, side_px);
  sample.crop = pictures::encode_jpeg(crop.rgb, 95);
  if (has_mask) sample.crop_mask = pictures::encode_png(crop.mask);
  sample.crop_side_px = crop.rgb.rows;
  sample.crop_from_image = pictures::compose(crop.from_image, sample.crop_from_image);
}

void give_body(manifests::ShardSample& sample, Uniform& uniform) {
  smal::AxisAnglePose turns{};
  for (float& turn : turns) turn = static_cast<float>(uniform(-1.5, 1.5));
  sample.body.pose = smal::rotation_matrices(turns);
  sample.body.translation = {0.1F, -0.2F, static_cast<float>(uniform(4.0, 8.0))};
  sample.body.camera = {static_cast<float>(2.0 * smal::kFocalInCropUnits / sample.body.translation[2]), 0.1F,
                        -0.2F};
  const smal::CropKeypoints annotated = pictures::keypoints_to_crop(
      sample.record.keypoints,
      pictures::patch_from_image(pictures::square_box(sample.record.box), pictures::kPatchSidePx));
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    const double depth = uniform(-0.4, 0.4) + sample.body.translation[2];
    const double x = (annotated[k].x + uniform(-0.02, 0.02)) * depth / smal::kFocalInCropUnits;
    const double y = (annotated[k].y + uniform(-0.02, 0.02)) * depth / smal::kFocalInCropUnits;
    float* point = &sample.keypoints_3d[3 * k];
    point[0] = static_cast<float>(x - sample.body.translation[0]);
    point[1] = static_cast<float>(y - sample.body.translation[1]);
    point[2] = static_cast<float>(depth - sample.body.translation[2]);
    const double z = double{point[2]} + sample.body.translation[2];
    sample.projected_2d[k] = {
        static_cast<float>(smal::kFocalInCropUnits * (double{point[0]} + sample.body.translation[0]) / z),
        static_cast<float>(smal::kFocalInCropUnits * (double{point[1]} + sample.body.translation[1]) / z)};
  }
  sample.judgement.initial_error = sample.judgement.final_error =
      filters::projection_error(sample.projected_2d, annotated).value();
}

}  // namespace

manifests::ShardSample body_sample(const std::string& id, unsigned seed, Stored stored) {
  manifests::ShardSample sample = shard_sample(id, seed, true);
  Uniform uniform(seed + 1000);
  sample.record.dataset = "zoo";
  sample.record.split = "train";
  sample.record.species = seed % 3 == 0 ? "red fox" : "wolf";
  sample.record.family = manifests::Family::canidae;
  sample.record.image_ref = id;
  sample.image_sha256 = std::string(60, 'a') + std::to_string(1000 + seed % 1000);
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) {
    manifests::Keypoint& keypoint = sample.record.keypoints[k];
    if (k % 5 == 4) keypoint = {-1.0, -1.0, -1.0F, 0.0F};  // as SuperAnimal writes what is not labelled
    if (k % 5 == 2) keypoint.v = 1.0F;
  }
  store_again(sample, seed % 2 == 0, stored);
  sample.label_kind = manifests::LabelKind::retained;
  give_body(sample, uniform);
  return sample;
}

void write_body_shard(const std::filesystem::path& path, const std::string& name, int count, unsigned seed,
                      std::int64_t unit) {
  std::vector<manifests::ShardSample> samples;
  for (int i = 0; i < count; ++i) {
    const std::string number = std::to_string(i);
    samples.push_back(body_sample("zoo/train/" + name + "_" + number + ".jpg#" + number,
                                  seed + static_cast<unsigned>(i),
                                  i % 2 == 0 ? Stored::whole : Stored::reduced));
  }
  manifests::ShardHeader header;
  header.dataset = "made";
  header.version = "v";
  header.unit = unit;
  header.datasets["zoo/train"] = {"CC-BY-4.0", "https://example.org/zoo", "A zoo"};
  manifests::write_shard(path, header, samples);
}

}  // namespace q3d::testing
