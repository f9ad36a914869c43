// The folders in which tests find their data and may write.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace q3d::testing {

inline std::filesystem::path data_dir() {
  return Q3D_TEST_DATA_DIR;
}

// Returns the folder of the golden numbers made with the official code: Q3D_PARITY_DIR, or the project's own
// copy.
inline std::filesystem::path parity_dir() {
  const char* given = std::getenv("Q3D_PARITY_DIR");
  return given != nullptr && *given != '\0' ? std::filesystem::path(given) : data_dir() / "parity";
}

// Returns the folder of the files that the project ships beside its code.
inline std::filesystem::path source_dir() {
  return data_dir().parent_path().parent_path();
}

// Returns the folder of samples of the real datasets, which cannot be shipped: Q3D_SAMPLES_DIR, or an empty
// path.
inline std::filesystem::path samples_dir() {
  const char* given = std::getenv("Q3D_SAMPLES_DIR");
  return given != nullptr ? given : "";
}

// A fresh, empty folder for one test, which the destructor removes.
class ScratchDir {
 public:
  ScratchDir() {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::temp_directory_path() / ("q3d_" + std::string(info->test_suite_name()) + "_" +
                                                      info->name() + "_" + std::to_string(::getpid()));
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~ScratchDir() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchDir(const ScratchDir&) = delete;
  ScratchDir& operator=(const ScratchDir&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace q3d::testing
