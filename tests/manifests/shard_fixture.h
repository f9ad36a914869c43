// The samples that the shard tests write. read_with_h5py.py holds the same constants: change both.
//
// Element k of an array column in row r is start + 100 r + k / 8, exact in float32; `start` differs by
// column.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "manifests/shard.h"
#include "smal/numbers.h"

namespace q3d::testing {

template <typename T, std::size_t N>
void fill(std::span<T, N> values, double start, int row) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    values[k] = static_cast<T>(start + 100.0 * row + static_cast<double>(k) / 8.0);
  }
}

inline std::vector<std::byte> text_bytes(const std::string& text) {
  const auto view = std::as_bytes(std::span(text));
  return {view.begin(), view.end()};
}

inline manifests::ShardSample make_shard_sample(int row) {
  using namespace manifests;
  ShardSample sample;
  SampleRecord& record = sample.record;
  record.id = "world/train/img" + std::to_string(row) + ".png#" + std::to_string(row);
  record.dataset = "world";
  record.split = "train";
  record.source = row == 0 ? "" : "sub";
  record.species = row == 0 ? "żubr" : "red fox";
  record.family = static_cast<Family>(row - 1);
  record.image_ref = "img" + std::to_string(row) + ".png";
  record.image_path = "/absolute/" + record.image_ref;
  record.mask_path = "/absolute/mask.png";
  record.width_px = 640;
  record.height_px = 480 + row;
  fill(std::span(&record.box.x_px, 4), 1, row);
  for (std::size_t k = 0; k < record.keypoints.size(); ++k) {
    fill(std::span(&record.keypoints[k].x_px, 2), 2 + static_cast<double>(2 * k) / 8.0, row);
    record.keypoints[k].v = k % 2 == 0 ? -1.0F : 2.0F;
    record.keypoints[k].weight = k % 2 == 0 ? 0.0F : 1.0F;
  }
  sample.image_sha256 = std::string(64, static_cast<char>('a' + row));
  sample.image_width_px = 641;
  sample.image_height_px = 481 + row;
  sample.crop =
      text_bytes("crop" + std::string(static_cast<std::size_t>(row), '\xff') + std::string(1, '\0'));
  if (row == 1) sample.crop_mask = text_bytes("mask");
  sample.crop_side_px = 480;
  fill(std::span(sample.crop_from_image), 3, row);
  fill(std::span(sample.patch_box), 4, row);

  sample.label_kind = row == 0 ? LabelKind::retained : LabelKind::refined;
  sample.judgement.verdict = row == 0 ? Verdict::retained : Verdict::refined;
  sample.judgement.initial_error = 0.25 + row;
  sample.judgement.final_error = 0.125 + row;
  if (row > 0) sample.judgement.gain = 0.5;
  sample.judgement.iterations = 10 * row;
  sample.judgement.best_iteration = 7 * row;
  if (row > 0) {  // column c is 15 + c / 8 above 100 r
    double at = 15.0 + 100.0 * row;
    for (const TrustColumn& column : kTrustColumns) {
      sample.judgement.trust.*column.score = at;
      at += 0.125;
    }
  }

  sample.has_pose = true;
  sample.has_keypoints_3d = row == 1;
  fill(std::span(sample.body.pose), 5, row);
  fill(std::span(sample.body.betas), 6, row);
  smal::NumbersOf<smal::Camera> camera{};
  fill(std::span(camera), 7, row);
  sample.body.camera = smal::from_numbers<smal::Camera>(camera);
  fill(std::span(sample.body.translation), 8, row);
  fill(std::span(sample.keypoints_3d), 9, row);
  smal::NumbersOf<smal::CropPoints> projected{};
  fill(std::span(projected), 10, row);
  sample.projected_2d = smal::from_numbers<smal::CropPoints>(projected);
  if (row == 1) {
    BodyTruth& truth = record.truth.emplace();
    truth.has_betas = true;
    fill(std::span(truth.pose_axis_angle), 11, row);
    fill(std::span(truth.betas), 12, row);
    fill(std::span(truth.trans), 13, row);
    fill(std::span(truth.keypoints_3d), 14, row);
  }
  return sample;
}

inline std::vector<manifests::ShardSample> make_shard_samples() {
  return {make_shard_sample(0), make_shard_sample(1), make_shard_sample(2)};
}

inline manifests::ShardHeader make_shard_header() {
  manifests::ShardHeader header;
  header.dataset = "quadruped3d";
  header.version = "0123456789ab";
  header.unit = 42;
  header.image_encoding = manifests::ImageEncoding::png;
  header.datasets["world/train"] = {"CC0-1.0", "https://example.org/world", "The \"world\" of 2026"};
  header.datasets["wild/test"] = {};
  return header;
}

}  // namespace q3d::testing
