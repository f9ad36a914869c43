#include "manifests/file_name.h"

#include <gtest/gtest.h>

#include <string>

namespace q3d::manifests {
namespace {

using namespace std::string_literals;

TEST(FileName, ANameIsOneComponent) {
  for (const auto& name : {"a"s, "made-0123456789ab"s, "dogs+cats"s, ".hidden"s, "..."s, "gämse 1.jpg"s}) {
    EXPECT_TRUE(is_file_name(name)) << name;
    EXPECT_TRUE(leads_below(name)) << name;
  }
  for (const auto& name : {""s, "."s, ".."s, "a/b"s, "/"s, "a\\b"s, "C:"s, "a\0b"s, "a\nb"s, "a\x7f"s}) {
    EXPECT_FALSE(is_file_name(name)) << name;
  }
}

TEST(FileName, APathLeadsBelowItsFolderOrIsNone) {
  for (const auto& path : {"images/a.jpg"s, "shards/000000.h5"s, "a/b/c"s})
    EXPECT_TRUE(leads_below(path)) << path;
  for (const auto& path : {""s, "/a"s, "//a"s, "a/"s, "a//b"s, "./a"s, "../a"s, "a/../../b"s, "a/.."s,
                           "a\\..\\b"s, "C:\\a"s, "c:/a"s, "a\0/b"s, "a/\0"s, "/"s}) {
    EXPECT_FALSE(leads_below(path)) << path;
  }
}

}  // namespace
}  // namespace q3d::manifests
