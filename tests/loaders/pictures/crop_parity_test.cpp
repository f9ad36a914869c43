// Crops and augmentation against the numbers of the official code (tests/data/parity/crops*, augment*).
#include <gtest/gtest.h>
#include <torch/types.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "loaders/pictures/augment.h"
#include "loaders/pictures/crop.h"
#include "loaders/pictures/demo_crop.h"
#include "smal/numbers.h"
#include "smal/tensors/safetensors.h"
#include "tests/support/paths.h"

namespace q3d::loaders::pictures {
namespace {

using manifests::Keypoint;
using manifests::kNumKeypoints;

struct Sample {  // one record of ann.json with its pictures
  cv::Mat rgb;
  cv::Mat mask;
  manifests::Box box;
  manifests::Keypoints keypoints;
  std::array<float, kNumKeypoints * 3> keypoints_3d{};
  std::array<float, 3> global_orient{};
};

std::vector<Sample> read_samples() {
  const auto folder = testing::parity_dir() / "crops";
  std::vector<Sample> samples;
  const auto annotations = nlohmann::json::parse(std::ifstream(folder / "ann.json"));
  for (const auto& record : annotations.at("data")) {
    Sample sample;
    cv::cvtColor(cv::imread(folder / record.at("img_path").get<std::string>()), sample.rgb,
                 cv::COLOR_BGR2RGB);
    sample.mask = cv::imread(folder / record.at("mask_path").get<std::string>(), cv::IMREAD_GRAYSCALE);
    const auto& box = record.at("bbox");
    sample.box = {box[0], box[1], box[2], box[3]};
    for (std::size_t i = 0; i < kNumKeypoints; ++i) {
      const auto& point = record.at("keypoint_2d")[i];
      sample.keypoints[i] = Keypoint{point[0], point[1], point[2], point[2]};
      for (std::size_t c = 0; record.contains("keypoint_3d") && c < 3; ++c) {
        sample.keypoints_3d[3 * i + c] = record["keypoint_3d"][i][c];
      }
    }
    for (std::size_t c = 0; record.contains("pose") && c < 3; ++c)
      sample.global_orient[c] = record["pose"][c];
    samples.push_back(std::move(sample));
  }
  return samples;
}

torch::Tensor tensor_of(const cv::Mat& image) {  // (C, H, W) uint8
  return torch::from_blob(image.data, {image.rows, image.cols, image.channels()}, torch::kUInt8)
      .permute({2, 0, 1})
      .contiguous();
}

torch::Tensor tensor_of(const Affine& affine) {
  return torch::tensor(std::vector<double>(affine.begin(), affine.end()), torch::kFloat64).view({2, 3});
}

template <std::size_t N>
torch::Tensor tensor_of(const std::array<float, N>& numbers) {
  return torch::tensor(std::vector<float>(numbers.begin(), numbers.end()));
}

torch::Tensor normalised(const cv::Mat& rgb, const std::array<double, 3>& colour) {  // (3, 256, 256) float32
  torch::Tensor planes = torch::empty({3, rgb.rows, rgb.cols});
  normalise_patch(rgb, colour, {planes.data_ptr<float>(), static_cast<std::size_t>(planes.numel())});
  return planes;
}

torch::Tensor every(const torch::Tensor& planes, std::int64_t step) {
  return planes.slice(-2, 0, planes.size(-2), step).slice(-1, 0, planes.size(-1), step);
}

void expect_equal(const torch::Tensor& got, const torch::Tensor& expected, const std::string& name) {
  ASSERT_EQ(got.sizes(), expected.sizes()) << name;
  EXPECT_TRUE(torch::equal(got.to(expected.dtype()), expected))
      << name << ": largest difference "
      << (got.to(torch::kFloat64) - expected.to(torch::kFloat64)).abs().max().item<double>();
}

void expect_near(const torch::Tensor& got, const torch::Tensor& expected, double tolerance,
                 const std::string& name) {
  ASSERT_EQ(got.sizes(), expected.sizes()) << name;
  const double difference =
      (got.to(torch::kFloat64) - expected.to(torch::kFloat64)).abs().max().item<double>();
  EXPECT_LE(difference, tolerance) << name;
}

// A few float32 roundings of the tensor's largest number, which may be one of several in a sum.
double few_roundings(const torch::Tensor& tensor) {
  return 4.0 * 0x1p-24 * tensor.abs().max().item<double>();
}

class CropParity : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_FALSE(samples_.empty()); }

  std::vector<Sample> samples_ = read_samples();
  smal::tensors::SafeTensors crops_ =
      smal::tensors::SafeTensors::open(testing::parity_dir() / "crops.safetensors");
  smal::tensors::SafeTensors augment_ =
      smal::tensors::SafeTensors::open(testing::parity_dir() / "augment.safetensors");
};

TEST_F(CropParity, train_geometry_and_keypoints) {
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const std::string name = "train" + std::to_string(i);
    const SquareBox box = square_box(samples_[i].box);
    const Affine affine = patch_from_image(box, kPatchSidePx);
    expect_equal(tensor_of(affine), crops_.tensor(name + "__trans"), name + "__trans");
    expect_equal(torch::tensor({box.center_x_px, box.center_y_px}), crops_.tensor(name + "_box_center"),
                 name);
    expect_equal(torch::tensor({box.side_px}, torch::kFloat64), crops_.tensor(name + "_box_size"), name);
    expect_equal(tensor_of(smal::numbers_of(keypoints_to_crop(samples_[i].keypoints, affine))).view({26, 3}),
                 crops_.tensor(name + "_keypoints_2d"), name + "_keypoints_2d");
  }
}

TEST_F(CropParity, evaluation_geometry_and_keypoints) {
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const std::string name = "eval" + std::to_string(i);
    const SquareBox box = evaluation_box(samples_[i].box);
    const Affine affine = patch_from_image(box, kPatchSidePx);
    expect_equal(tensor_of(affine), crops_.tensor(name + "__trans"), name + "__trans");
    expect_equal(torch::tensor({box.side_px}, torch::kFloat64), crops_.tensor(name + "_box_size"), name);
    expect_equal(tensor_of(smal::numbers_of(keypoints_to_crop(samples_[i].keypoints, affine))).view({26, 3}),
                 crops_.tensor(name + "_keypoints_2d"), name + "_keypoints_2d");
    const Patch patch = make_patch(samples_[i].rgb, samples_[i].mask, box);
    const bool equals_train =
        torch::equal(tensor_of(patch.rgb), crops_.tensor("train" + std::to_string(i) + "_patch_u8"));
    EXPECT_EQ(equals_train, crops_.tensor(name + "_patch_equals_train").item<std::uint8_t>() == 1) << name;
  }
}

TEST_F(CropParity, patches_masks_and_normalised_pictures) {
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const std::string name = "train" + std::to_string(i);
    const Patch patch = make_patch(samples_[i].rgb, samples_[i].mask, square_box(samples_[i].box));
    expect_equal(tensor_of(patch.rgb), crops_.tensor(name + "_patch_u8"), name + "_patch_u8");
    expect_equal(tensor_of(patch.mask)[0], crops_.tensor(name + "_mask_u8"), name + "_mask_u8");

    const torch::Tensor inside = tensor_of(border_mask(patch.rgb))[0].gt(0);
    const torch::Tensor bits = torch::tensor({128, 64, 32, 16, 8, 4, 2, 1}, torch::kInt32);
    const torch::Tensor packed = (inside.view({256, 32, 8}) * bits).sum(-1);
    expect_equal(packed, crops_.tensor(name + "_border_mask").to(torch::kInt64), name + "_border_mask");

    const torch::Tensor planes = normalised(patch.rgb, {1.0, 1.0, 1.0});
    expect_equal(every(planes, 16), crops_.tensor(name + "_img_every16"), name + "_img_every16");
    expect_near(planes.to(torch::kFloat64).sum({1, 2}), crops_.tensor(name + "_img_sum"), 1e-6,
                name + "_img_sum");
  }
}

TEST_F(CropParity, global_orientation_passes_through_matrices_without_rotation) {
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const std::string name = "train" + std::to_string(i) + "_smal_global_orient";
    expect_near(tensor_of(rotate_global_orient(samples_[i].global_orient, 0.0)), crops_.tensor(name), 1e-6,
                name);
  }
}

TEST_F(CropParity, augmented_patches_and_labels) {
  const auto meta =
      nlohmann::json::parse(std::ifstream(testing::parity_dir() / "augment.json")).at("meta").at("draws");
  ASSERT_GT(meta.size(), 0U);
  for (std::size_t i = 0; i < meta.size(); ++i) {
    const std::string name = "aug" + std::to_string(i);
    const auto& draw = meta[i];
    const Sample& sample = samples_.at(draw.at("sample").get<std::size_t>());
    const Augmentation drawn{draw.at("scale"), draw.at("rot"), draw.at("tx"), draw.at("ty"),
                             draw.at("color")};
    const Border border = draw.at("border") == "replicate" ? Border::replicate : Border::constant;

    const Affine affine = augmented_patch_from_image(square_box(sample.box), drawn);
    expect_equal(tensor_of(affine), augment_.tensor(name + "__trans"), name + "__trans");
    const Patch patch = warp_patch(sample.rgb, sample.mask, affine, border);
    // The reference has the mask before the rule that replaces an almost empty one.
    torch::Tensor warped = tensor_of(patch.rgb);
    if (patch.has_mask) warped = torch::cat({warped, tensor_of(patch.mask)});
    const bool whole = augment_.contains(name + "_warped_u8");
    const std::string warped_name = name + (whole ? "_warped_u8" : "_warped_u8_every4");
    expect_equal(every(warped, whole ? 1 : 4), augment_.tensor(warped_name).slice(0, 0, warped.size(0)),
                 warped_name);
    const torch::Tensor planes = normalised(patch.rgb, drawn.colour);
    expect_equal(every(planes, 8), augment_.tensor(name + "_img_every8"), name + "_img_every8");
    expect_near(planes.to(torch::kFloat64).sum({1, 2}), augment_.tensor(name + "_img_sum"), 1e-6,
                name + "_img_sum");
    expect_near(tensor_of(patch.mask).to(torch::kFloat64).sum().view({1}) / 255.0,
                augment_.tensor(name + "_mask_sum"), 1e-2, name + "_mask_sum");

    expect_equal(tensor_of(smal::numbers_of(keypoints_to_crop(sample.keypoints, affine))).view({26, 3}),
                 augment_.tensor(name + "_keypoints_2d"), name + "_keypoints_2d");
    const torch::Tensor turned = augment_.tensor(name + "_keypoints_3d").slice(1, 0, 3);
    expect_near(tensor_of(rotate_keypoints_3d(sample.keypoints_3d, drawn.rotation_deg)).view({26, 3}), turned,
                few_roundings(turned), name + "_keypoints_3d");
    expect_near(tensor_of(rotate_global_orient(sample.global_orient, drawn.rotation_deg)),
                augment_.tensor(name + "_global_orient"), 1e-6, name + "_global_orient");
  }
}

TEST_F(CropParity, demo_crops) {
  struct Case {
    std::string name;
    std::size_t sample;
    std::array<int, 2> aspect;
  };
  std::vector<Case> cases{{"demobig2", 2, {0, 0}}, {"demobig4", 4, {0, 0}}};
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    cases.push_back({"demo" + std::to_string(i), i, {0, 0}});
    cases.push_back({"demo" + std::to_string(i) + "_bboxshape", i, {192, 256}});
  }
  for (const auto& [name, sample, aspect] : cases) {
    const torch::Tensor box = crops_.tensor(name + "_boxes").to(torch::kFloat32).view(-1);
    const float* corner = box.data_ptr<float>();
    const DemoCrop crop =
        demo_crop(samples_[sample].rgb, {corner[0], corner[1], corner[2], corner[3]}, aspect);
    expect_equal(torch::tensor({crop.center_x_px, crop.center_y_px}), crops_.tensor(name + "_box_center"),
                 name);
    const torch::Tensor side = crops_.tensor(name + "_box_size");
    expect_near(torch::tensor({crop.side_px}), side, few_roundings(side), name);
    const torch::Tensor planes = torch::tensor(crop.planes).view({3, kPatchSidePx, kPatchSidePx});
    const std::int64_t step = crops_.contains(name + "_img_every4") ? 4 : 16;
    const std::string picture = name + "_img_every" + std::to_string(step);
    // Blurred pictures are double sums in another order than scipy's, then float32.
    const double tolerance = crop.side_px / 512.0 > 1.1 ? 1e-6 : 0.0;
    expect_near(every(planes, step), crops_.tensor(picture), tolerance, picture);
    expect_near(planes.to(torch::kFloat64).sum({1, 2}), crops_.tensor(name + "_img_sum"), 1e-3,
                name + "_img_sum");
  }
}

}  // namespace
}  // namespace q3d::loaders::pictures
