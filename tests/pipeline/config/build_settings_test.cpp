// The tables of settings: what is shown parses to the same, and the page and the schema hold every key.
#include "pipeline/config/build_settings.h"

#include <gtest/gtest.h>

#include <set>

#include "manifests/atomic_file.h"
#include "pipeline/config/config_schema.h"
#include "pipeline/config/settings_page.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::json;

// Shown settings that are read again are the same settings.
template <typename Struct>
void expect_round_trip(const Settings<Struct>& settings, const Struct& config) {
  const json shown = show_settings(settings, config);
  Struct again;
  JsonFields fields(shown, "t");
  for (Setting<Struct> setting : settings) {
    setting.is_required = false;  // an empty path is not shown
    read_setting(fields, setting, again);
  }
  EXPECT_NO_THROW(fields.finish());
  EXPECT_EQ(json(show_settings(settings, again)), shown);
}

TEST(Settings, DefaultsAndOtherValuesRoundTrip) {
  expect_round_trip(network_settings(), NetworkConfig{});
  expect_round_trip(network_settings(), NetworkConfig{"c", "s", "cpu", Dtype::bfloat16, 3, 2});
  expect_round_trip(tta_settings(), TtaConfig{});
  expect_round_trip(tta_settings(),
                    TtaConfig{TtaObjective::demo, 0.25, 1.0, 2.0, 0.01, 0.02, 3, 4, 0.5, true, 5});
  expect_round_trip(shard_settings(), ShardConfig{8, manifests::ImageEncoding::reference, 1, 4.0, 256});
  GuardConfig guards;
  guards.visible_min = 26;
  guards.held_out_seed = 18446744073709551615U;
  guards.held_out_share = 0.5;
  guards.priors = "p";
  expect_round_trip(guard_settings(), guards);
  FilterConfig filter;
  expect_round_trip(filter_settings(), filter);
  filter.tau_low = 0.125;
  expect_round_trip(filter_settings(), filter);
}

TEST(Settings, DefaultsAreWithinTheirRanges) {
  const auto check = [](const std::vector<SettingFacts>& facts) {
    for (const SettingFacts& fact : facts) {
      EXPECT_FALSE(fact.description.empty()) << fact.key;
      if (fact.value.is_number()) {
        EXPECT_TRUE(fact.range.holds(fact.value.get<double>())) << fact.key;
      }
    }
  };
  check(facts_of(network_settings()));
  check(facts_of(tta_settings()));
  check(facts_of(guard_settings()));
  check(facts_of(shard_settings()));
  check(facts_of(calibrate_settings()));
  check(facts_of(own_label_settings()));
}

TEST(Range, OpenEndsDoNotBelongToIt) {
  const Range range{.least = 0, .most = 1, .is_open_below = true, .is_open_above = true};
  EXPECT_FALSE(range.holds(0.0));
  EXPECT_TRUE(range.holds(0.5));
  EXPECT_FALSE(range.holds(1.0));
  EXPECT_EQ(range.text(), "greater than 0 and less than 1");
  EXPECT_EQ((Range{.least = 1, .most = 4}).text(), "1 to 4");
  EXPECT_FALSE((Range{.least = 0}).holds(std::nan("")));
}

TEST(Settings, OnlyWhatDecidesAStageIsInItsKey) {
  const json parts = key_parts(shard_settings(), ShardConfig{}, DecidedStage::shards);
  EXPECT_EQ(parts, json::parse(R"({"images": "jpeg", "jpeg_quality": 95, "crop_scale": 1.9,
                                   "crop_min_side_px": 480})"));
  EXPECT_EQ(key_parts(shard_settings(), ShardConfig{}, DecidedStage::predict), json({{"unit_size", 512}}));
}

TEST(SettingsPage, TheTablesOfDocsConfigAreTheSettings) {
  const std::string page = manifests::read_file(testing::source_dir() / "docs/config.md");
  EXPECT_EQ(with_settings_tables(page, build_settings_tables()), page)
      << "run: build/quadruped3d config tables docs/config.md --write";
}

TEST(SettingsPage, KnowsWhoseTablesAPageHas) {
  EXPECT_TRUE(has_settings_table("text\n<!-- settings: tta -->\n", build_settings_tables()));
  EXPECT_FALSE(has_settings_table("<!-- settings: phases -->\n", build_settings_tables()));
}

TEST(SettingsPage, RefusesAPageThatLacksATable) {
  EXPECT_THROW(with_settings_tables("no table", build_settings_tables()), std::runtime_error);
  EXPECT_THROW(
      with_settings_tables("<!-- settings: nothing -->\n<!-- end of settings -->\n", build_settings_tables()),
      std::runtime_error);
}

TEST(ConfigSchema, HasEveryKeyWithItsRange) {
  const json schema = build_config_schema();
  EXPECT_EQ(schema["additionalProperties"], false);
  const json& shards = schema["properties"]["shards"]["properties"];
  EXPECT_EQ(shards["jpeg_quality"]["minimum"], 1.0);
  EXPECT_EQ(shards["jpeg_quality"]["maximum"], 100.0);
  EXPECT_EQ(shards["images"]["enum"], json({"jpeg", "png", "reference"}));
  EXPECT_EQ(schema["properties"]["tta"]["properties"]["learning_rate"]["exclusiveMinimum"], 0.0);
  EXPECT_EQ(schema["properties"]["datasets"]["items"]["required"],
            json({"name", "format", "root", "annotations"}));
}

}  // namespace
}  // namespace q3d::pipeline::config
