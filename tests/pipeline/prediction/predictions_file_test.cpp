#include "pipeline/prediction/predictions_file.h"

#include <gtest/gtest.h>

namespace q3d::pipeline::prediction {
namespace {

using nlohmann::json;

PredictionSummary one_animal() {
  PredictionSummary summary;
  PredictedAnimal& animal = summary.animals.emplace_back();
  animal.record.id = "photos/train/a.jpg#0";
  animal.record.image_ref = "a.jpg";
  animal.record.box = {100.0, 50.0, 200.0, 80.0};  // the crop: centre (200, 90), side 200
  animal.image_width_px = 640;
  animal.image_height_px = 480;
  animal.body.translation = {0.1F, -0.2F, 4.0F};
  animal.body.keypoints_3d[0] = 0.3F;
  animal.body.keypoints_3d[1] = 0.4F;
  animal.body.keypoints_3d[2] = 1.0F;
  // The pinhole projection of keypoint 0: focal 1000 / 256 crop sides.
  animal.body.keypoints_2d[0] = {1000.0F / 256.0F * 0.4F / 5.0F, 1000.0F / 256.0F * 0.2F / 5.0F};
  return summary;
}

TEST(PredictionsFile, ThePinholeCameraGivesTheKeypointsInThePicture) {
  const json document = predictions_document(one_animal());
  const json& body = document["animals"][0]["body"];
  const double focal = body["camera"]["focal_px"];
  const json& centre = body["camera"]["principal_point_px"];
  // A point of the body, translation added: (0.4, 0.2, 5).
  EXPECT_NEAR(body["keypoints_2d_px"][0][0], centre[0].get<double>() + focal * 0.4 / 5.0, 1e-4);
  EXPECT_NEAR(body["keypoints_2d_px"][0][1], centre[1].get<double>() + focal * 0.2 / 5.0, 1e-4);
  EXPECT_EQ(centre, json({200.0, 90.0}));
  EXPECT_DOUBLE_EQ(focal, 1000.0 / 256.0 * 200.0);
}

TEST(PredictionsFile, AnAnimalWithoutABodySaysWhy) {
  PredictionSummary summary = one_animal();
  summary.animals[0].failure = manifests::Reason::image_truncated;
  summary.animals[0].detail = "ends after 100 bytes";
  const json animal = predictions_document(summary)["animals"][0];
  EXPECT_EQ(animal["failure"], "image_truncated");
  EXPECT_EQ(animal["detail"], "ends after 100 bytes");
  EXPECT_FALSE(animal.contains("body"));
}

TEST(PredictionsFile, AdaptationSaysWhichIterateWasKept) {
  PredictionSummary summary = one_animal();
  EXPECT_TRUE(predictions_document(summary)["animals"][0]["adaptation"].is_null());
  summary.animals[0].curve = {0.05, 0.03, 0.04};
  summary.animals[0].best_iteration = 1;
  EXPECT_EQ(predictions_document(summary)["animals"][0]["adaptation"],
            nlohmann::ordered_json(
                {{"iterations", 2}, {"kept_iterate", 1}, {"l_proj_before", 0.05}, {"l_proj_after", 0.03}}));
}

}  // namespace
}  // namespace q3d::pipeline::prediction
