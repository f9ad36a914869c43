#include "pipeline/build/file_stamps.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/next_field.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;
using ::testing::UnorderedElementsAre;

class FileStamps : public ::testing::Test {
 protected:
  std::string file(const std::string& name, const std::string& content = "x") {
    const fs::path path = scratch_.path() / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << content;
    return path.string();
  }
  testing::ScratchDir scratch_;
};

// The files of a text of lines; nothing if one of them is no such line.
std::optional<std::vector<StampedFile>> read_text(std::string_view text) {
  StampReader reader;
  std::vector<StampedFile> files;
  while (!text.empty()) {
    if (!reader.read(manifests::next_field(text, '\n'), files)) return std::nullopt;
  }
  return files;
}

TEST_F(FileStamps, AreTheSameAfterText) {
  const auto files =
      stamp_files({file("a/b with a space"), file("a/c"), (scratch_.path() / "a/gone").string(), file("d"),
                   file("a/e"), scratch_.path().string(), "no folder"});
  StampWriter writer;
  std::string text;
  ASSERT_TRUE(writer.append(std::span(files).first(2), text));
  ASSERT_TRUE(writer.append(std::span(files).subspan(2), text));
  EXPECT_EQ(text.find("/a/\n"), text.find("/a/\n+")) << "the first folder stands once for its files";
  const auto read = read_text(text);
  ASSERT_TRUE(read);
  ASSERT_EQ(read->size(), files.size());
  for (std::size_t i = 0; i < files.size(); ++i) {
    EXPECT_EQ((*read)[i].path, files[i].path);
    EXPECT_EQ((*read)[i].stamp, files[i].stamp) << files[i].path;
  }
  EXPECT_TRUE(have_stamps(*read));
}

TEST_F(FileStamps, ChangeWithTheFile) {
  const std::string path = file("a", "12");
  const auto files = stamp_files({path, (scratch_.path() / "gone").string()});
  const auto time = fs::last_write_time(path);
  std::ofstream(path, std::ios::binary) << "13";
  fs::last_write_time(path, time);  // size, inode and mtime are the old ones
  EXPECT_FALSE(have_stamps(files));
  const auto again = stamp_files({path, (scratch_.path() / "gone").string()});
  EXPECT_TRUE(have_stamps(again));
  file("gone");
  EXPECT_FALSE(have_stamps(again));
}

TEST_F(FileStamps, OfANameWithALineFeedHaveNoText) {
  std::string text;
  EXPECT_FALSE(StampWriter().append(stamp_files({file("a\nb")}), text));
}

TEST_F(FileStamps, OtherTextIsRefused) {
  for (const std::string text : {"+ 1 2 3\n", "+ x 1 2 3 4 path\n", " \n", "* 1\n", "path\n"}) {
    EXPECT_FALSE(read_text(text)) << text;
  }
}

TEST_F(FileStamps, FoldersBelowLeaveOutLinksAndTheExcepted) {
  file("a/b/picture");
  file("out/stages/table");
  fs::create_directory_symlink(scratch_.path() / "a", scratch_.path() / "link");
  const std::string root = scratch_.path().string();
  const auto folders = folders_below(root, scratch_.path() / "out", 100);
  ASSERT_TRUE(folders);
  EXPECT_THAT(*folders, UnorderedElementsAre(root, root + "/a", root + "/a/b"));
  EXPECT_FALSE(folders_below(root, {}, 2));
  EXPECT_FALSE(folders_below(root + "/absent", {}, 100));
}

}  // namespace
}  // namespace q3d::pipeline::build
