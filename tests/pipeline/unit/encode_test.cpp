// Stored crops: which are encoded, how often, and what a shard gets of them.
#include "pipeline/unit/encode.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

#include "loaders/pictures/encode.h"
#include "pipeline/unit/decode.h"
#include "pipeline/unit/shard_assembly.h"

namespace q3d::pipeline::unit {
namespace {

using manifests::Verdict;

constexpr int kSidePx = 300;

// Four candidates whose pictures have been decoded: plain grey crops, of another grey for each.
struct DecodedUnit {
  std::vector<candidates::Candidate> candidates{4};
  config::ShardConfig shards;
  UnitWork work;

  DecodedUnit() {
    shards.images = manifests::ImageEncoding::png;
    set_candidates(work, candidates);
    set_predictions(work, std::vector<PredictedSample>(4));
    work.refined.emplace();
    decode();
    keep({});
  }
  static cv::Mat grey(std::size_t sample) {
    return cv::Mat(kSidePx, kSidePx, CV_8UC3, cv::Scalar::all(10.0 * static_cast<double>(sample + 1)));
  }
  void decode() {
    work.decoded.assign(4, {});
    for (std::size_t i = 0; i < 4; ++i) {
      work.decoded[i].stored_crop =
          loaders::pictures::StoredCrop{grey(i), cv::Mat(), {1, 0, static_cast<double>(i), 0, 1, 0}};
    }
  }
  void keep(const std::vector<std::size_t>& samples) {
    work.judgements.assign(4, {});
    for (manifests::Judgement& each : work.judgements) each.verdict = Verdict::discarded;
    for (const std::size_t i : samples) work.judgements[i].verdict = Verdict::retained;
  }
  std::vector<std::size_t> stored() const {
    std::vector<std::size_t> samples;
    for (const EncodedCrop& crop : work.crops) samples.push_back(crop.sample);
    return samples;
  }
};

TEST(EncodeCrops, OnlyTheKeptAreEncoded) {
  DecodedUnit unit;
  unit.keep({1, 3});
  encode_crops(unit.work, unit.shards);
  EXPECT_EQ(unit.stored(), (std::vector<std::size_t>{1, 3}));
  EXPECT_EQ(unit.work.crops_encoded, 2U);
  const EncodedCrop& crop = *find_crop(unit.work, 3);
  EXPECT_EQ(crop.side_px, kSidePx);
  EXPECT_EQ(crop.from_image[2], 3.0);
  EXPECT_TRUE(crop.mask.empty());
  const cv::Mat read = loaders::pictures::decode_stored(crop.picture, 3);
  EXPECT_EQ(cv::norm(read, DecodedUnit::grey(3), cv::NORM_INF), 0.0);
  EXPECT_EQ(find_crop(unit.work, 2), nullptr);
  EXPECT_TRUE(unit.work.decoded.empty()) << "the pixels are freed";
}

TEST(EncodeCrops, WhatIsThereIsNotEncodedAgain) {
  DecodedUnit unit;
  unit.keep({1, 3});
  encode_crops(unit.work, unit.shards);
  const std::byte* const before = find_crop(unit.work, 3)->picture.data();
  unit.decode();
  unit.keep({0, 3});  // another tau
  encode_crops(unit.work, unit.shards);
  EXPECT_EQ(unit.work.crops_encoded, 1U);
  EXPECT_EQ(unit.stored(), (std::vector<std::size_t>{0, 1, 3})) << "in the order of the candidates";
  EXPECT_EQ(find_crop(unit.work, 3)->picture.data(), before) << "moved, not copied";
}

TEST(EncodeCrops, AUnitWhoseShardIsThereNeedsNone) {
  DecodedUnit unit;
  unit.keep({1});
  unit.work.shard_before = true;
  encode_crops(unit.work, unit.shards);
  EXPECT_TRUE(unit.work.crops.empty());
}

TEST(EncodeCrops, AReferenceHasNoBytes) {
  DecodedUnit unit;
  unit.shards.images = manifests::ImageEncoding::reference;
  unit.keep({2});
  encode_crops(unit.work, unit.shards);
  EXPECT_TRUE(find_crop(unit.work, 2)->picture.empty());
  EXPECT_EQ(find_crop(unit.work, 2)->side_px, kSidePx);
}

TEST(EncodeCrops, APictureThatIsGoneIsNamed) {
  DecodedUnit unit;
  unit.candidates[1].record.image_path = "/pictures/fox.jpg";
  unit.keep({1});
  unit.work.decoded[1] = {};
  try {
    encode_crops(unit.work, unit.shards);
    FAIL() << "a label without its picture went through";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("/pictures/fox.jpg"), std::string::npos) << error.what();
  }
}

TEST(FreeUnneededCrops, FreesTheDroppedAlone) {
  DecodedUnit unit;
  config::JudgingRules rules;
  rules.thresholds[""] = {};
  for (std::size_t i = 0; i < 4; ++i) unit.work.errors[i] = 0.0;
  unit.keep({0, 2});
  free_unneeded_crops(unit.work, rules);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(unit.work.decoded[i].stored_crop.has_value(), i % 2 == 0) << i;
  }
}

TEST(ShardSamples, TakeTheBytesWithoutACopy) {
  DecodedUnit unit;
  unit.keep({1, 3});
  encode_crops(unit.work, unit.shards);
  const std::byte* const picture = find_crop(unit.work, 3)->picture.data();
  unit.keep({3});  // the crop of 1 stays from an earlier verdict
  unit.work.predicted->at(3).image_width_px = 640;
  const std::vector<manifests::ShardSample> samples = shard_samples(unit.work);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].crop.data(), picture);
  EXPECT_EQ(samples[0].crop_side_px, kSidePx);
  EXPECT_EQ(samples[0].crop_from_image[2], 3.0);
  EXPECT_EQ(samples[0].image_width_px, 640);
  unit.keep({0});
  EXPECT_THROW(shard_samples(unit.work), std::logic_error) << "kept without a crop";
}

}  // namespace
}  // namespace q3d::pipeline::unit
