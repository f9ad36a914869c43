#include "pipeline/training/settings/training_settings.h"

#include <gtest/gtest.h>

#include "manifests/atomic_file.h"
#include "pipeline/training/settings/training_schema.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::training::settings {
namespace {

using nlohmann::json;

TEST(TrainingSettingsPage, TheTablesOfDocsTrainingAreTheSettings) {
  const std::string page = manifests::read_file(testing::source_dir() / "docs/training.md");
  EXPECT_EQ(config::with_settings_tables(page, training_settings_tables()), page)
      << "run: build/quadruped3d config tables docs/training.md --write";
}

TEST(TrainingSchema, HasEveryKeyWithItsRange) {
  const json schema = training_config_schema();
  EXPECT_EQ(schema["additionalProperties"], false);
  const json& properties = schema["properties"];
  EXPECT_EQ(properties["batch"]["maximum"], 65536.0);
  EXPECT_EQ(properties["loss_weights"]["properties"]["betas"]["default"], 0.0005);
  EXPECT_EQ(properties["network"]["properties"]["precision"]["enum"], json({"auto", "float32", "bfloat16"}));
  EXPECT_EQ(properties["network"]["properties"]["without"]["items"]["enum"].size(), 3U);
  const json& phase = properties["stages"]["additionalProperties"]["items"];
  EXPECT_EQ(phase["required"], json({"name", "pools", "steps"}));
  EXPECT_EQ(phase["properties"]["pools"]["type"], "array");
  EXPECT_EQ(phase["properties"]["learning_rate"]["exclusiveMinimum"], 0.0);
}

}  // namespace
}  // namespace q3d::pipeline::training::settings
