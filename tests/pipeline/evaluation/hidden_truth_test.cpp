#include "pipeline/evaluation/hidden_truth.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/paths.h"

namespace q3d::pipeline::evaluation {
namespace {

using nlohmann::json;

json good() {
  json keypoints_2d = json::array(), keypoints_3d = json::array();
  for (int k = 0; k < manifests::kNumKeypoints; ++k) {
    keypoints_2d.push_back({k, 2 * k, k % 2});
    keypoints_3d.push_back({0.5, k, -1});
  }
  return {{"pictures",
           {{"images/a.jpg",
             {{"species", "wolf"},
              {"family", 1},
              {"pose", std::vector<double>(105, 0.25)},
              {"betas", std::vector<double>(41, -0.5)},
              {"trans", {1, 2, 3}},
              {"keypoint_2d", keypoints_2d},
              {"keypoint_3d", keypoints_3d},
              {"mask_path", "masks/a.png"}}}}}};
}

class HiddenTruthFile : public ::testing::Test {
 protected:
  HiddenTruthFile() {
    std::filesystem::create_directories(scratch_.path() / "masks");
    std::ofstream(scratch_.path() / "masks" / "a.png") << "a file";
  }
  HiddenTruth read(const json& document, bool with_masks = true) const {
    std::ofstream(scratch_.path() / "truth.json") << document.dump();
    return {scratch_.path() / "truth.json", with_masks ? scratch_.path() : std::filesystem::path()};
  }
  testing::ScratchDir scratch_;
};

TEST_F(HiddenTruthFile, CompletesTheRecordsOfItsPictures) {
  std::vector<manifests::SampleRecord> records(2);
  records[0].id = "s/test/images/a.jpg#0";
  records[0].image_ref = "images/a.jpg";
  records[1].image_ref = "images/b.jpg";
  const HiddenTruth truth = read(good());
  EXPECT_EQ(truth.size(), 1U);
  EXPECT_EQ(truth.complete(records), 1U);
  ASSERT_TRUE(records[0].truth.has_value());
  EXPECT_TRUE(records[0].truth->has_pose && records[0].truth->has_betas &&
              records[0].truth->has_keypoints_3d);
  EXPECT_FLOAT_EQ(records[0].truth->pose_axis_angle[104], 0.25F);
  EXPECT_FLOAT_EQ(records[0].truth->betas[40], -0.5F);
  EXPECT_FLOAT_EQ(records[0].truth->trans[2], 3.0F);
  EXPECT_FLOAT_EQ(records[0].truth->keypoints_3d[3 * 7 + 1], 7.0F);
  EXPECT_EQ(records[0].species, "wolf");
  EXPECT_EQ(records[0].family, manifests::Family::canidae);
  EXPECT_EQ(std::filesystem::path(records[0].mask_path).filename(), "a.png");
  EXPECT_FALSE(records[1].truth.has_value());
  const manifests::Keypoint& hidden = truth.find("images/a.jpg")->keypoints[4];
  const manifests::Keypoint& seen = truth.find("images/a.jpg")->keypoints[5];
  EXPECT_EQ(hidden.weight, 0.0F);
  EXPECT_EQ(seen.weight, 1.0F);
  EXPECT_EQ(seen.y_px, 10.0);
}

TEST_F(HiddenTruthFile, WithoutTheFolderThereAreNoMasks) {
  std::vector<manifests::SampleRecord> records(1);
  records[0].image_ref = "images/a.jpg";
  records[0].mask_path = "/its/own.png";
  read(good(), false).complete(records);
  EXPECT_EQ(records[0].mask_path, "/its/own.png");
}

TEST_F(HiddenTruthFile, TwoAnimalsCannotShareATruth) {
  std::vector<manifests::SampleRecord> records(2);
  records[0].image_ref = records[1].image_ref = "images/a.jpg";
  EXPECT_THROW(read(good()).complete(records), std::runtime_error);
}

TEST_F(HiddenTruthFile, NamesWhatIsWrong) {
  struct Broken {
    const char* field;
    json value;
    const char* expected;
  };
  const std::vector<Broken> cases{
      {"species", 3, "a text"},
      {"family", 5, "0 to 4"},
      {"family", 1.5, "0 to 4"},
      {"pose", std::vector<double>(104, 0.0), "expected 105"},
      {"betas", "none", "finite number"},
      {"trans", {1, nullptr, 3}, "finite number"},
      {"keypoint_2d", std::vector<double>(77, 0.0), "expected 78"},
      {"mask_path", "masks/b.png", "below the folder of masks"},
      {"mask_path", "../outside.png", "below the folder of masks"},
  };
  for (const Broken& broken : cases) {
    json document = good();
    document["pictures"]["images/a.jpg"][broken.field] = broken.value;
    try {
      read(document);
      FAIL() << broken.field << " " << broken.value;
    } catch (const std::runtime_error& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find("images/a.jpg"), std::string::npos) << what;
      EXPECT_NE(what.find(broken.field), std::string::npos) << what;
      EXPECT_NE(what.find(broken.expected), std::string::npos) << what;
    }
    document["pictures"]["images/a.jpg"].erase(broken.field);
    if (std::string(broken.field) != "mask_path") {
      EXPECT_THROW(read(document), std::runtime_error) << broken.field << " is missing";
    }
  }
  EXPECT_THROW(read(json::array()), std::runtime_error);
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
