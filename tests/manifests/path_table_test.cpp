#include "manifests/path_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <string>
#include <vector>

namespace q3d::manifests {
namespace {

TEST(PathTable, GivesEveryPathOneNumber) {
  PathTable table;
  EXPECT_EQ(table.find("/a/b"), std::nullopt);
  EXPECT_EQ(table.add("/a/b"), std::pair(0U, true));
  EXPECT_EQ(table.add("/a/c"), std::pair(1U, true));
  EXPECT_EQ(table.add("/a/b"), std::pair(0U, false));
  for (const char* path : {"b", "/b", "/a/", "a/b", "", "/a/b/c"}) {
    EXPECT_EQ(table.find(path), std::nullopt) << path;
    EXPECT_TRUE(table.add(path).second) << path;
    EXPECT_EQ(table.path(table.find(path).value()), path);
  }
  EXPECT_EQ(table.size(), 8U);
  EXPECT_EQ(table.folder(0), "/a/");
  EXPECT_EQ(table.name(1), "c");
  EXPECT_EQ(&table.folder(0), &table.folder(1));
}

TEST(PathTable, HoldsManyPathsAndLongNames) {
  PathTable table;
  std::vector<std::string> paths;
  for (int i = 0; i < 20'000; ++i) {
    paths.push_back("/data/" + std::to_string(i % 37) + "/" + std::to_string(i) + ".jpg");
  }
  paths.push_back("/data/" + std::string(200'000, 'x'));  // longer than a block of names
  paths.push_back("/data/after");
  for (std::size_t i = 0; i < paths.size(); ++i) EXPECT_EQ(table.add(paths[i]).first, i);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    ASSERT_EQ(table.find(paths[i]), i);
    ASSERT_EQ(table.path(static_cast<std::uint32_t>(i)), paths[i]);
  }
}

TEST(PathTable, SortsByTheWholePath) {
  PathTable table;
  // '-' and '.' are smaller than '/', so that folders do not lie behind each other as a whole.
  std::vector<std::string> paths{"/a/b", "/a-b/c", "/a.d", "/a/b/c", "/a", "b", "/a/a", "/a/b-c/d", "/a/b.d"};
  for (const std::string& path : paths) table.add(path);
  std::vector<std::string> sorted;
  for (const std::uint32_t number : table.sorted()) sorted.push_back(table.path(number));
  std::sort(paths.begin(), paths.end());
  EXPECT_EQ(sorted, paths);
}

}  // namespace
}  // namespace q3d::manifests
