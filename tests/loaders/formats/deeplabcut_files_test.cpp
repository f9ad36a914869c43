#include "loaders/formats/deeplabcut_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/loaders/formats/annotation_files.h"

namespace q3d::loaders::formats {
namespace {

using namespace testing_files;  // NOLINT: the vocabulary of these tests
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class LabelFiles : public ::testing::Test {
 protected:
  std::filesystem::path root() const { return scratch_.path() / "project"; }
  void make(const std::string& name, const std::string& text = "x") const { write_text(root() / name, text); }
  std::vector<std::string> files() {
    notes_ = {};
    std::vector<std::string> names;
    for (const auto& file : project_label_files(root() / "labeled-data", root(), notes_)) {
      names.push_back(file.lexically_relative(root() / "labeled-data").string());
    }
    return names;
  }
  std::string refusal() {
    try {
      files();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }
  std::string notes() const { return joined(notes_.list()); }

 private:
  q3d::testing::ScratchDir scratch_;
  Notes notes_;
};

TEST_F(LabelFiles, one_a_folder_and_the_h5_before_the_csv) {
  make("labeled-data/b/CollectedData_Ada.csv");
  make("labeled-data/b/CollectedData_Ada.h5");
  make("labeled-data/a/CollectedData_Bo.csv");
  make("labeled-data/a/notes.csv");
  make("labeled-data/a/._CollectedData_Bo.csv");
  EXPECT_THAT(files(), ElementsAre("a/CollectedData_Bo.csv", "b/CollectedData_Ada.h5"));
  EXPECT_EQ(notes(), "");
}

TEST_F(LabelFiles, the_scorer_of_config_yaml_decides) {
  make("labeled-data/a/CollectedData_Ada.csv");
  make("labeled-data/a/CollectedData_Bo.h5");
  EXPECT_THAT(refusal(), HasSubstr("CollectedData_Ada.csv, CollectedData_Bo.h5"));
  for (const char* line : {"scorer: Bo", "scorer:   'Bo'  # mine", "Task: a\nscorer: \"Bo\"\r\ndate: May"}) {
    make("config.yaml", line);
    EXPECT_THAT(files(), ElementsAre("a/CollectedData_Bo.h5")) << line;
    EXPECT_THAT(notes(),
                HasSubstr("CollectedData_Bo.h5 is read, and CollectedData_Ada.csv beside it is left out"));
  }
  make("config.yaml", "scorer: Cy\n");
  EXPECT_THAT(refusal(), HasSubstr("scorer"));
  std::filesystem::remove(root() / "config.yaml");
  write_text(root().parent_path() / "config.yaml", "scorer: Bo\n");
  EXPECT_NE(refusal(), "") << "a file above the root is another project's";
}

TEST_F(LabelFiles, backups_of_deeplabcut_are_known_by_name) {
  make("labeled-data/a/CollectedData_Ada.h5");
  make("labeled-data/a/CollectedData_Adasingleanimal.h5");
  make("labeled-data/a/CollectedData_Adawindows.csv");
  EXPECT_THAT(files(), ElementsAre("a/CollectedData_Ada.h5"));
  EXPECT_THAT(notes(), HasSubstr("CollectedData_Adasingleanimal.h5, CollectedData_Adawindows.csv beside it"));
  make("labeled-data/a/CollectedData_Bo.h5");
  EXPECT_THAT(refusal(), HasSubstr("CollectedData_Bo.h5"));
}

TEST_F(LabelFiles, a_backup_alone_is_read) {
  make("labeled-data/a/CollectedData_Adasingleanimal.h5");
  EXPECT_THAT(files(), ElementsAre("a/CollectedData_Adasingleanimal.h5"));
}

}  // namespace
}  // namespace q3d::loaders::formats
