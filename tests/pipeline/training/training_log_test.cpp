#include "pipeline/training/training_log.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "manifests/atomic_file.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::training {
namespace {

std::vector<nlohmann::json> lines(const std::filesystem::path& path) {
  std::vector<nlohmann::json> result;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) result.push_back(nlohmann::json::parse(line));
  return result;
}

TEST(TrainingLog, WritesWhatItIsGiven) {
  const testing::ScratchDir scratch;
  TrainingLog(scratch.path() / "log.jsonl", 0, 0)
      .write({1, "joint", 30, 2.5, 0.25, 1e-4, 12.0, 60.0, {{"pose", 1.5}, {"betas", 0.5}}});
  const auto got = lines(scratch.path() / "log.jsonl");
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got[0], nlohmann::json::parse(R"({"phase": 1, "phase_name": "joint", "step": 30, "loss": 2.5,
      "terms": {"pose": 1.5, "betas": 0.5}, "gradient_norm": 0.25, "learning_rate": 1e-4,
      "samples_per_second": 12.0, "seconds": 60.0})"));
}

TEST(TrainingLog, DropsStepsThatWillBeRepeatedAndTornLines) {
  const testing::ScratchDir scratch;
  const auto path = scratch.path() / "log.jsonl";
  {
    TrainingLog log(path, 0, 0);
    for (const auto& [phase, step] : {std::pair{0, 10}, {0, 20}, {1, 10}, {1, 20}}) {
      LogLine line;
      line.phase = phase;
      line.step = step;
      log.write(line);
    }
  }
  std::ofstream(path, std::ios::app) << R"({"phase": 1, "st)";
  const TrainingLog log(path, 1, 10);
  const auto got = lines(path);
  ASSERT_EQ(got.size(), 3U);
  EXPECT_EQ(got.back().at("phase"), 1);
  EXPECT_EQ(got.back().at("step"), 10);
}

TEST(TrainingLog, DropsLinesWithValuesOfOtherTypes) {
  const testing::ScratchDir scratch;
  const auto path = scratch.path() / "log.jsonl";
  std::ofstream(path)
      << "{\"phase\": \"a\"}\n{\"phase\": 0, \"step\": []}\n[]\n7\n{}\n{\"phase\": 0, \"step\": 3}\n";
  const TrainingLog log(path, 0, 5);
  EXPECT_EQ(lines(path), std::vector<nlohmann::json>{nlohmann::json::parse(R"({"phase": 0, "step": 3})")});
}

TEST(TrainingLog, ABadPathIsNamed) {
  EXPECT_THROW(TrainingLog("/nonexistent/folder/log.jsonl", 0, 0), std::runtime_error);
}

}  // namespace
}  // namespace q3d::pipeline::training
