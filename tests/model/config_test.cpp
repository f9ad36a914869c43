#include "model/config.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace q3d::model {
namespace {

std::string message_of(const nlohmann::json& json) {
  try {
    config_from_json(json);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(Config, DefaultsAreThePaperSizes) {
  const PrimaConfig config = named_config("vith");
  EXPECT_EQ(config.embed_dim, 1280);
  EXPECT_EQ(config.depth, 32);
  EXPECT_EQ(config.dec_layers, 6);
  EXPECT_EQ(config, config_from_json(nlohmann::json::object()));
}

TEST(Config, JsonRoundTripKeepsEveryField) {
  for (const std::string name : {"vith", "small", "lite", "tiny"}) {
    PrimaConfig config = named_config(name);
    config.clip_quick_gelu = true;
    config.focal_px = 812.5;
    config.ief_iterations = 3;
    EXPECT_EQ(config_from_json(nlohmann::json::parse(to_json(config).dump())), config) << name;
  }
}

TEST(Config, NamedSizesFitTogether) {
  for (const std::string name : {"vith", "small", "lite", "tiny"})
    EXPECT_NO_THROW(check_config(named_config(name)));
  try {
    named_config("huge");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("vith, small, lite, tiny"), std::string::npos);
  }
}

TEST(Config, UnknownKeyNamesTheNearest) {
  const std::string message = message_of({{"dec_layer", 6}});
  EXPECT_NE(message.find("'dec_layer'"), std::string::npos) << message;
  EXPECT_NE(message.find("'dec_layers'"), std::string::npos) << message;
  EXPECT_NE(message_of({{"focal", 1000}}).find("'focal_px'"), std::string::npos);
}

TEST(Config, WrongTypesAreNamed) {
  EXPECT_NE(message_of({{"depth", 2.5}}).find("'depth' must be an integer"), std::string::npos);
  EXPECT_NE(message_of({{"depth", "two"}}).find("'depth' must be an integer"), std::string::npos);
  EXPECT_NE(message_of({{"clip_quick_gelu", 1}}).find("true or false"), std::string::npos);
  EXPECT_NE(message_of({{"focal_px", "1000"}}).find("a number"), std::string::npos);
  EXPECT_NE(message_of(nlohmann::json::array()).find("object"), std::string::npos);
}

TEST(Config, ImpossibleSizesAreRefused) {
  EXPECT_NE(message_of({{"heads", 7}}).find("'heads' = 7 does not divide 'embed_dim' = 1280"),
            std::string::npos);
  EXPECT_NE(message_of({{"clip_heads", 5}}).find("'clip_width'"), std::string::npos);
  EXPECT_NE(message_of({{"dec_dim", 1278}, {"dec_heads", 2}}).find("multiple of 4"), std::string::npos);
  EXPECT_NE(message_of({{"dec_layers", 1}}).find("at least 2"), std::string::npos);
  EXPECT_NE(message_of({{"depth", 0}}).find("'depth' = 0"), std::string::npos);
  EXPECT_NE(message_of({{"depth", -3}}).find("'depth' = -3"), std::string::npos);
  EXPECT_NE(message_of({{"stem_depth", -1}}).find("[0, "), std::string::npos);
  EXPECT_NE(message_of({{"clip_stem_depth", 2}, {"clip_width", 96}}).find("'clip_width' = 96"),
            std::string::npos);
  EXPECT_NE(message_of({{"stem_depth", 2}, {"efficientnet_stem", true}})
                .find("'stem_depth' = 2 and 'efficientnet_stem' exclude each other"),
            std::string::npos);
  EXPECT_NE(message_of({{"clip_stem_depth", 2}, {"clip_efficientnet_stem", true}})
                .find("'clip_stem_depth' = 2 and"),
            std::string::npos);
  EXPECT_NE(message_of({{"embed_dim", 1LL << 40}}).find("'embed_dim'"), std::string::npos);
  EXPECT_NE(message_of({{"focal_px", 0}}).find("'focal_px'"), std::string::npos);
  EXPECT_NE(message_of({{"dropout", 1.0}}).find("[0, 1)"), std::string::npos);
}

}  // namespace
}  // namespace q3d::model
