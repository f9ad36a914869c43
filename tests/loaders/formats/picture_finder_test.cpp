#include "loaders/formats/picture_finder.h"

#include <gtest/gtest.h>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using manifests::Reason;

class Finder : public ::testing::Test {
 protected:
  std::filesystem::path root() const { return scratch_.path() / "dogs"; }
  void make(const std::string& name) const { write_picture(root() / name); }
  PictureFinder finder(const std::string& images = "", const std::string& annotations = "") const {
    return PictureFinder(
        {.root = root(), .images = images, .default_images = "images", .annotations = annotations});
  }
  // Relative to the root; the reason's name if there is none.
  std::string found(PictureFinder& finder, const std::string& name) const {
    const FoundPicture picture = finder.find(name);
    if (picture.failure != Reason::none) return std::string(manifests::to_string(picture.failure));
    return picture.path.lexically_relative(std::filesystem::canonical(root())).string();
  }

 private:
  q3d::testing::ScratchDir scratch_;
};

TEST_F(Finder, counts_from_the_pictures_the_root_and_the_annotations_in_this_order) {
  for (const char* name :
       {"images/a.png", "a.png", "b.png", "export/a.png", "export/b.png", "export/c.png"}) {
    make(name);
  }
  PictureFinder here = finder("", "export");
  EXPECT_EQ(found(here, "a.png"), "images/a.png");
  EXPECT_EQ(found(here, "b.png"), "b.png");
  EXPECT_EQ(found(here, "c.png"), "export/c.png");
  EXPECT_EQ(found(here, "../export/b.png"), "export/b.png");
  EXPECT_EQ(found(here, "../b.png"), "b.png");
  EXPECT_EQ(found(here, "../../b.png"), "path_escapes_root");
}

TEST_F(Finder, what_follows_the_root_s_own_name) {
  make("images/sub/a.png");
  PictureFinder here = finder();
  EXPECT_EQ(found(here, "data/dogs/images/sub/a.png"), "images/sub/a.png");
  EXPECT_EQ(found(here, "dogs\\images\\sub\\a.png"), "images/sub/a.png");
  EXPECT_EQ(found(here, "data/cats/images/sub/a.png"), "images/sub/a.png");
  EXPECT_EQ(found(here, "data/cats/sub/a.png"), "image_missing") << "a name relative to another folder";
  EXPECT_EQ(here.found_by_tail(), 0U);
  EXPECT_GE(here.found_by_reading(), 3U);
}

// A name that is there as it stands is never read in another way.
TEST_F(Finder, the_literal_name_comes_first) {
  make("images/a%20b.png");
  make("images/a b.png");
  make("images/c\\d.png");
  make("images/c/d.png");
  PictureFinder here = finder();
  EXPECT_EQ(found(here, "a%20b.png"), "images/a%20b.png");
  EXPECT_EQ(found(here, "c\\d.png"), "images/c\\d.png");
  EXPECT_EQ(here.found_by_reading(), 0U);
}

TEST_F(Finder, in_one_folder_alone) {
  make("walk/a.png");
  write_picture(root().parent_path() / "outside/a.png");
  PictureFinder here = finder();
  EXPECT_TRUE(here.find_in(root() / "walk", "labeled-data\\old\\a.png").has_value());
  EXPECT_FALSE(here.find_in(root() / "walk", "b.png").has_value());
  EXPECT_FALSE(here.find_in(root().parent_path() / "outside", "a.png").has_value());
  EXPECT_EQ(here.relative_to_root(root() / "walk"), "walk");
  EXPECT_EQ(here.relative_to_root(root().parent_path()), "");
}

// Messages become parts of verdicts, which are equal wherever the dataset lies.
TEST_F(Finder, messages_name_folders_relative_to_the_root) {
  make("a.png");
  std::filesystem::create_symlink("gone.png", root() / "link.png");
  EXPECT_EQ(finder().find("b.png").got, "b.png, which is not below the root");
  EXPECT_EQ(finder().find("link.png").got, "link.png, a link to nothing");
  EXPECT_EQ(finder().find("/x/b.png").got,
            "/x/b.png, which is outside the root, and no file of its name is below the root");
  make("images/c.png");
  EXPECT_EQ(finder().find("b.png").got, "b.png, which is not below images");
  const std::filesystem::path pictures = root().parent_path() / "pictures";
  write_picture(pictures / "d.png");
  std::filesystem::create_symlink("../secret.png", pictures / "out.png");
  write_picture(root().parent_path() / "secret.png");
  EXPECT_EQ(finder(pictures.string()).find("b.png").got, "b.png, which is not below the folder of pictures");
  EXPECT_EQ(finder(pictures.string()).find("out.png").got, "out.png, a link that leads outside the root");
}

TEST_F(Finder, nothing_outside_the_root_is_found_in_any_spelling) {
  make("images/a.png");
  write_picture(root().parent_path() / "secret.png");
  PictureFinder here = finder("", "images");
  const std::string absolute = (root().parent_path() / "secret.png").string();
  for (const std::string& name :
       {std::string("../secret.png"), std::string("../../secret.png"), std::string("..\\..\\secret.png"),
        std::string("%2e%2e/%2e%2e/secret.png"), std::string("..%5c..%5csecret.png"), absolute,
        "file://" + absolute, std::string("C:\\..\\..\\secret.png"), std::string("images/../../secret.png"),
        std::string("https://host/../../secret.png"), std::string("?d=../../secret.png")}) {
    const std::string path = found(here, name);
    EXPECT_TRUE(path == "path_escapes_root" || path == "image_missing") << name << ": " << path;
  }
}

}  // namespace
}  // namespace q3d::loaders::formats
