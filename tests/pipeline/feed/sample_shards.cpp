#include "tests/pipeline/feed/sample_shards.h"

#include <cmath>
#include <random>

#include "loaders/pictures/encode.h"
#include "loaders/pictures/stored_crop.h"
#include "manifests/digest.h"

namespace q3d::testing {

manifests::ShardSample shard_sample(const std::string& id, unsigned seed, bool labelled) {
  std::mt19937 engine(seed);
  const auto uniform = [&engine](double low, double high) {
    return low + (high - low) * static_cast<double>(engine()) / 4294967296.0;
  };
  cv::Mat picture(240, 320, CV_8UC3);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      picture.at<cv::Vec3b>(y, x) = {static_cast<unsigned char>(x * 255 / 320), static_cast<unsigned char>(y),
                                     static_cast<unsigned char>(128.0 + 100.0 * std::sin(x * 0.1 + seed))};
    }
  }
  manifests::ShardSample sample;
  sample.record.id = id;
  sample.record.dataset = "made";
  sample.record.split = "train";
  sample.record.species = seed % 2 == 0 ? "lynx" : "okapi";
  sample.record.family = seed % 6 == 5 ? manifests::Family::none : static_cast<manifests::Family>(seed % 6);
  sample.record.box = {uniform(40, 60), uniform(30, 50), uniform(120, 160), uniform(100, 140)};
  for (auto& keypoint : sample.record.keypoints) {
    keypoint = {uniform(60, 200), uniform(50, 170), 2.0F, 1.0F};
  }
  const loaders::pictures::SquareBox box = loaders::pictures::square_box(sample.record.box);
  const loaders::pictures::StoredCrop stored = loaders::pictures::make_stored_crop(picture, cv::Mat(), box);
  sample.image_width_px = picture.cols;
  sample.image_height_px = picture.rows;
  sample.crop = loaders::pictures::encode_png(stored.rgb);
  sample.image_sha256 = manifests::sha256(sample.crop);  // stands for that of the picture
  sample.crop_side_px = stored.rgb.rows;
  sample.crop_from_image = stored.from_image;
  sample.patch_box = {box.center_x_px, box.center_y_px, box.side_px};
  sample.label_kind = labelled ? manifests::LabelKind::truth : manifests::LabelKind::two_d_only;
  sample.judgement.verdict = manifests::Verdict::retained;
  sample.has_pose = sample.has_betas = sample.has_keypoints_3d = labelled;
  if (!labelled) return sample;
  for (std::size_t joint = 0; joint < manifests::kNumJoints; ++joint) {  // turns about the camera's axis
    const double angle = uniform(-1, 1);
    const std::array<double, 9> turn{
        std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1};
    for (std::size_t i = 0; i < 9; ++i) sample.body.pose[joint * 9 + i] = static_cast<float>(turn[i]);
  }
  for (float& beta : sample.body.betas) beta = static_cast<float>(uniform(-1, 1));
  for (float& coordinate : sample.keypoints_3d) coordinate = static_cast<float>(uniform(-0.5, 0.5));
  return sample;
}

void write_sample_shard(const std::filesystem::path& path, const std::string& name, int count,
                        unsigned seed) {
  std::vector<manifests::ShardSample> samples;
  samples.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    samples.push_back(
        shard_sample(name + "/" + std::to_string(i), seed + static_cast<unsigned>(i), i % 2 == 0));
  }
  manifests::ShardHeader header;
  header.dataset = name;
  header.version = "v";
  header.image_encoding = manifests::ImageEncoding::png;
  manifests::write_shard(path, header, samples);
}

}  // namespace q3d::testing
