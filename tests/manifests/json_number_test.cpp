#include "manifests/json_number.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace q3d::manifests {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(JsonNumber, WholeNumbersWithinTheBounds) {
  EXPECT_EQ(whole_number(json::parse("0")), 0);
  EXPECT_EQ(whole_number(json::parse("9223372036854775807")), std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(whole_number(json::parse("-5"), -5, 5), -5);
}

TEST(JsonNumber, EverythingElseIsRefused) {
  for (const char* text : {"-1", "2.0", "1e300", "-1e300", "true", "null", "\"1\"", "[1]", "{}",
                           "9223372036854775808", "18446744073709551615"}) {
    EXPECT_THAT([&] { whole_number(json::parse(text)); },
                ThrowsMessage<std::runtime_error>(HasSubstr("expected a whole number from 0 to ")))
        << text;
  }
  EXPECT_THROW(whole_number(json::parse("6"), 0, 5), std::runtime_error);
  EXPECT_THAT(
      [] {
        whole_number_at(json{{"rows", 1e300}}, "rows");
      },
      ThrowsMessage<std::runtime_error>(HasSubstr("rows: got 1e+300, expected")));
  EXPECT_THROW(whole_number_at(json::object(), "rows"), json::exception);
}

}  // namespace
}  // namespace q3d::manifests
