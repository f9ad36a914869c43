#include "manifests/json_elements.h"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/json_file.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class JsonElements : public ::testing::Test {
 protected:
  // Writes the file, and returns its document with the elements of "data" put back.
  json read(std::string_view text) {
    write_file_atomically(file_, text);
    elements_.clear();
    rest_ = read_json_elements(file_, "data", [this](json&& element) { elements_.push_back(element); });
    json document = rest_;
    if (!elements_.empty()) document["data"] = elements_;
    return document;
  }
  // What read_json_file throws.
  std::string message() const {
    try {
      read_json_file(file_);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "nothing";
  }

  testing::ScratchDir scratch_;
  std::filesystem::path file_ = scratch_.path() / "labels.json";
  std::vector<json> elements_;
  json rest_;
};

TEST_F(JsonElements, AreThoseOfTheWholeDocument) {
  for (const char* text :
       {R"({"data": [{"a": [1, {"b": 2}]}, 3, "x", null, [4, [5]], {}], "more": {"data": [7]}})",
        R"({"first": [1, 2], "data": []})", R"({"data": {"data": [1]}})", R"([{"data": [1]}])", "3", "{}",
        R"({"other": {"data": [1]}, "data": [1.5, -2, true]})", "\xef\xbb\xbf{\"data\": [1]}",
        R"({"data": [NaN, {"a": -Infinity}, 1e999]})"}) {
    const json document = read(text);
    EXPECT_EQ(document, read_json_file(file_)) << text;
  }
  EXPECT_EQ(read(R"({"data": [1, 2], "n": 3})")["data"].size(), 2U);
  EXPECT_EQ(rest_, json::parse(R"({"data": [], "n": 3})"));
}

TEST_F(JsonElements, OfAnotherEncodingAreRead) {
  const std::string utf16(
      "\xff\xfe{\0\"\0d\0a\0t\0a\0\"\0:\0[\0"
      "7\0]\0}\0",
      26);
  EXPECT_EQ(read(utf16), json::parse(R"({"data": [7]})"));
}

// Words that JSON lacks, escapes and numbers lie across the ends of the blocks in which the file is read.
TEST_F(JsonElements, AreReadAcrossBlocks) {
  std::string text = R"({"data": [)";
  for (int i = 0; i < 30'000; ++i) {
    text += (i > 0 ? "," : "") + std::string(i % 7, ' ') + R"({"number": )" + std::to_string(i * 1.25) +
            R"(, "text": "a \" NaN \\", "none": [NaN, -Infinity, 1e400]})";
  }
  text += R"(], "n": 1})";
  ASSERT_GT(text.size(), std::size_t{2} << 20U);
  const json document = read(text);
  EXPECT_EQ(document, read_json_file(file_));
  EXPECT_EQ(elements_.size(), 30'000U);
}

TEST_F(JsonElements, OfADamagedFileEndWithTheMessageOfTheWhole) {
  const std::string deep = std::string(300, '[') + std::string(300, ']');
  for (const std::string& text :
       {std::string(R"({"data": [1, 2)"), std::string("{\"data\": [1,\n 2,\n }"), std::string(),
        std::string(R"({"data": [{"a": 1, "a": 2}]})"), std::string(R"({"data": [1], "data": [2]})"),
        R"({"data": [)" + deep + "]}", std::string("<html>"), std::string("{\"data\": [1]} {}"),
        std::string("{\"data\": [\"\xff\"]}"), std::string("img,x,y\n"), std::string(R"({"data": [1e])")}) {
    EXPECT_THAT([&] { read(text); }, ThrowsMessage<std::runtime_error>(HasSubstr(file_.string()))) << text;
    ASSERT_NE(message(), "nothing") << text;
    EXPECT_THAT([&] { read(text); }, ThrowsMessage<std::runtime_error>(message())) << text;
  }
  const std::filesystem::path absent = scratch_.path() / "absent.json";
  EXPECT_THAT([&] { read_json_elements(absent, "data", [](json&&) {}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("expected an annotation file in JSON")));
}

TEST_F(JsonElements, WhatTheTakerThrowsIsPassedOn) {
  write_file_atomically(file_, R"({"data": [1, 2]})");
  EXPECT_THROW(read_json_elements(file_, "data", [](json&&) { throw std::logic_error("enough"); }),
               std::logic_error);
}

}  // namespace
}  // namespace q3d::manifests
