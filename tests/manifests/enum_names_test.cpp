#include "manifests/enum_names.h"

#include <gtest/gtest.h>

namespace q3d::manifests {
namespace {

enum class Gait : std::int8_t { unknown = -1, walk, trot };
constexpr EnumNames kGaits("gait", Gait::unknown, Gait::trot, {"unknown", "walk", "trot"});

TEST(EnumNames, LeadFromEnumeratorsToNamesAndBack) {
  EXPECT_EQ(kGaits.name(Gait::unknown), "unknown");
  EXPECT_EQ(kGaits.name(Gait::trot), "trot");
  for (const std::string_view name : kGaits.all()) EXPECT_EQ(kGaits.name(kGaits.value(name)), name);
}

TEST(EnumNames, AnUnknownNameListsTheKnownOnes) {
  try {
    kGaits.value("gallop");
    FAIL() << "expected std::invalid_argument";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "unknown gait \"gallop\"; known: unknown walk trot");
  }
}

TEST(EnumNames, AValueThatIsNoEnumeratorHasNoName) {
  EXPECT_THROW(kGaits.name(static_cast<Gait>(2)), std::out_of_range);
  EXPECT_THROW(kGaits.name(static_cast<Gait>(-2)), std::out_of_range);
}

}  // namespace
}  // namespace q3d::manifests
