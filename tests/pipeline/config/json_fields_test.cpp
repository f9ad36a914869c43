#include "pipeline/config/json_fields.h"

#include <gtest/gtest.h>

namespace q3d::pipeline::config {
namespace {

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const run::ConfigError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(JsonFields, KeepsDefaultsAndReadsWhatIsThere) {
  const auto json = nlohmann::json::parse(R"({"b": 3, "word": "x"})");
  int a = 7;
  int b = 7;
  std::optional<double> absent;
  std::string word;
  JsonFields fields(json, "here");
  fields.read("a", a);
  fields.read("b", b);
  fields.read("absent", absent);
  fields.require("word", word);
  fields.finish();
  EXPECT_EQ(a, 7);
  EXPECT_EQ(b, 3);
  EXPECT_EQ(word, "x");
  EXPECT_FALSE(absent.has_value());
}

TEST(JsonFields, NamesTheNearestKnownKey) {
  const auto json = nlohmann::json::parse(R"({"tau_hihg": 1})");
  const std::string message = message_of([&] {
    std::optional<double> value;
    JsonFields fields(json, "config.json: filter");
    fields.read("tau_low", value);
    fields.read("tau_high", value);
    fields.finish();
  });
  EXPECT_EQ(message, "config.json: filter: unknown key \"tau_hihg\"; did you mean \"tau_high\"?");
}

TEST(JsonFields, SaysWhatWasExpectedAndGot) {
  const auto json = nlohmann::json::parse(R"({"n": 1.5, "s": 3, "b": "yes", "big": 99999999999, "neg": -1})");
  int n = 0;
  std::string s;
  bool b = false;
  std::uint64_t unsigned_number = 0;
  const auto read = [&](const char* key, auto& value) {
    return message_of([&] {
      JsonFields fields(json, "f");
      fields.read(key, value);
    });
  };
  EXPECT_EQ(read("n", n), "f: \"n\" must be a whole number, got 1.5");
  EXPECT_EQ(read("s", s), "f: \"s\" must be a string, got 3");
  EXPECT_EQ(read("b", b), "f: \"b\" must be true or false, got \"yes\"");
  EXPECT_EQ(read("big", n), "f: \"big\" must be a whole number of at most 31 bits, got 99999999999");
  EXPECT_EQ(read("neg", unsigned_number), "f: \"neg\" must be a whole number, 0 or more, got -1");
}

TEST(JsonFields, MissingRequiredKeyAndWrongContainer) {
  const auto empty = nlohmann::json::object();
  const auto list = nlohmann::json::array();
  std::string value;
  EXPECT_EQ(message_of([&] { JsonFields(empty, "f").require("name", value); }),
            "f: the key \"name\" is missing");
  EXPECT_EQ(message_of([&] { JsonFields(list, "f"); }), "f: expected a JSON object, got array");
}

}  // namespace
}  // namespace q3d::pipeline::config
