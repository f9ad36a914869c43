#include "pipeline/evaluation/report.h"

#include <gtest/gtest.h>

#include <fstream>

#include "manifests/atomic_file.h"
#include "pipeline/evaluation/evaluation_files.h"
#include "tests/pipeline/evaluation/made_evaluation.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Family;
using testing::evaluation_of;
using testing::failed;
using testing::sample;

Evaluation made() {
  return evaluation_of({sample("a,b.jpg#0", Family::felidae, 80.125, 50.0),
                        sample("c.jpg#0", Family::canidae, 60.0), failed("d.jpg#0")});
}

TEST(Report, EveryNumberIsInTheJson) {
  const Evaluation evaluation = made();
  const auto document = to_json(evaluation, make_tables(evaluation));
  const auto& row = document["tables"]["datasets"][0];
  EXPECT_DOUBLE_EQ(row["auc"].get<double>(), (80.125 + 60.0) / 2);
  EXPECT_TRUE(row["pa_mpvpe_mm"].is_null());
  EXPECT_EQ(row["samples_of_mean"]["pa_mpjpe_mm"], 1);
  EXPECT_EQ(row["normaliser"], "mask");
  EXPECT_EQ(document["tables"]["families"].size(), 2U);
  const auto& out = document["datasets"][0]["left_out"];
  EXPECT_EQ(out["samples"], 1);
  EXPECT_EQ(out["reasons"]["image_missing"], 1);
  EXPECT_EQ(out["list"][0]["id"], "d/test/d.jpg#0");
  EXPECT_EQ(document["datasets"][0]["evaluated"], 2);
  EXPECT_EQ(document["checkpoint"]["sha256"], evaluation.checkpoint_sha256);
}

TEST(Report, WhatIsWrittenIsReadBack) {
  const q3d::testing::ScratchDir scratch;
  const Evaluation evaluation = made();
  write_evaluation(scratch.path() / "out", evaluation, make_tables(evaluation));
  for (const auto& path : {scratch.path() / "out", scratch.path() / "out" / "evaluation.json"}) {
    const StoredEvaluation stored = read_evaluation(path);
    EXPECT_EQ(stored.checkpoint, "model.safetensors");
    EXPECT_EQ(stored.setting_names, std::vector<std::string>{"prediction"});
    const auto& samples = stored.datasets.at("d/test").settings.at("prediction");
    ASSERT_EQ(samples.size(), 2U);
    EXPECT_EQ(samples[0].id, "d/test/a,b.jpg#0");
    EXPECT_EQ(samples[0].values, evaluation.datasets[0].samples[0].values[0]);
    EXPECT_EQ(samples[1].values, evaluation.datasets[0].samples[1].values[0]);
  }
}

TEST(Report, AForeignOrDamagedFileIsNamed) {
  const q3d::testing::ScratchDir scratch;
  const Evaluation evaluation = made();
  write_evaluation(scratch.path(), evaluation, make_tables(evaluation));
  const auto expect_named = [&](const char* file, const std::string& from, const std::string& to) {
    const std::string good = manifests::read_file(scratch.path() / file);
    ASSERT_NE(good.find(from), std::string::npos);
    std::string bad = good;
    bad.replace(bad.find(from), from.size(), to);
    std::ofstream(scratch.path() / file) << bad;
    try {
      read_evaluation(scratch.path());
      ADD_FAILURE() << to;
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(file), std::string::npos) << error.what();
    }
    std::ofstream(scratch.path() / file) << good;
  };
  expect_named("evaluation.json", "quadruped3d-evaluation", "something-else");
  expect_named("evaluation.json", "\"settings\"", "\"setting\"");
  expect_named("samples.csv", "pck_0.10", "pck");
  expect_named("samples.csv", "80.125", "eighty");
  expect_named("samples.csv", "d/test,d/test/c.jpg", "e/test,d/test/c.jpg");
}

TEST(Report, PeopleAreToldWhatWasLeftOut) {
  Evaluation evaluation = made();
  const std::string text = summary_text(evaluation, make_tables(evaluation), false);
  EXPECT_NE(text.find("left out of d/test: 1 of 3 (1 image_missing)"), std::string::npos) << text;
  EXPECT_EQ(text.find("uses the test keypoints"), std::string::npos);
  evaluation.settings[0].uses_test_keypoints = true;
  EXPECT_NE(summary_text(evaluation, make_tables(evaluation), false).find("* uses the test keypoints"),
            std::string::npos);
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
