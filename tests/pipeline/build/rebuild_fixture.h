// A small build that brings its labels, so that it needs no network, and the damage that tests do to its
// files.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "manifests/atomic_file.h"
#include "pipeline/build/build.h"
#include "tests/support/paths.h"
#include "tests/support/told.h"

namespace q3d::pipeline::build {

namespace fs = std::filesystem;
using nlohmann::json;

inline constexpr int kPictures = 6;
inline constexpr int kUnitSize = 2;

class Rebuild : public ::testing::Test {
 protected:
  Rebuild() {
    json records = json::array();
    for (int i = 0; i < kPictures; ++i) records.push_back(record(i));
    fs::create_directories(scratch_.path() / "data");
    std::ofstream(scratch_.path() / "data/train.json") << json{{"data", records}};
  }

  json record(int i) {
    const std::string name = "images/p" + std::to_string(i) + ".png";
    save_picture(name, cv::Mat(90, 120, CV_8UC3, cv::Scalar(10 * i, 120, 200)));
    const std::string mask = "masks/m" + std::to_string(i) + ".png";
    cv::Mat silhouette(90, 120, CV_8UC1, cv::Scalar(0));
    silhouette(cv::Rect(20, 20, 60, 50)) = 255;
    save_picture(mask, silhouette);
    json keypoints = json::array();
    for (int k = 0; k < 26; ++k) keypoints.push_back({20 + 2 * k, 25 + k, 1});
    return {{"img_path", name},
            {"mask_path", mask},
            {"bbox", {10, 10, 80, 70}},
            {"keypoint_2d", keypoints},
            {"pose", std::vector<double>(105, 0.01 * (i + 1))},
            {"shape", std::vector<double>(20, 0.2)},
            {"shape_extra", std::vector<double>(21, 0.3)},
            {"trans", {0.1, 0.2, 5.0}},
            {"supercategory", 2}};
  }

  void save_picture(const std::string& name, const cv::Mat& picture) {
    std::vector<std::uint8_t> png;
    cv::imencode(".png", picture, png);
    write(scratch_.path() / "data" / name, {reinterpret_cast<const char*>(png.data()), png.size()});
  }

  // Writes in place, as damage does: the inode stays, and so do other names of the file.
  static void write(const fs::path& path, std::string_view content) {
    fs::create_directories(path.parent_path());
    std::error_code ignored;
    fs::permissions(path, fs::perms::owner_write, fs::perm_options::add, ignored);
    std::ofstream(path, std::ios::binary) << content;
  }

  static void flip_bit(const fs::path& path, std::size_t at) {
    std::string content = manifests::read_file(path);
    content.at(at) ^= 4;
    write(path, content);
  }

  config::BuildConfig config(int jpeg_quality = 95) const {
    return config::parse_build_config(
        {{"name", "tiny"},
         {"datasets",
          {{{"name", "tiny"},
            {"format", "prima"},
            {"root", (scratch_.path() / "data").string()},
            {"annotations", "train.json"},
            {"role", "truth"}}}},
         {"shards", {{"unit_size", kUnitSize}, {"jpeg_quality", jpeg_quality}}}},
        "t");
  }

  BuildSummary run(const std::string& out, int jpeg_quality = 95) {
    run::RunOptions options;
    options.out = scratch_.path() / out;
    options.quiet = true;
    told_.clear();
    return build(config(jpeg_quality), options);
  }

  fs::path stage(const std::string& out, const std::string& name) const {
    for (const auto& entry : fs::directory_iterator(scratch_.path() / out / "stages")) {
      if (entry.path().filename().string().starts_with(name + "-")) return entry.path();
    }
    throw std::logic_error("no stage " + name);
  }

  // Removes what starts with one of `beginnings` from the output folder and its stages.
  void remove_from(const std::string& out, const std::vector<std::string>& beginnings) {
    for (const fs::path& folder : {scratch_.path() / out / "stages", scratch_.path() / out}) {
      const std::vector<fs::directory_entry> entries{fs::directory_iterator(folder), {}};
      for (const auto& entry : entries) {
        const std::string name = entry.path().filename().string();
        const auto starts = [&](const std::string& beginning) { return name.starts_with(beginning); };
        if (std::any_of(beginnings.begin(), beginnings.end(), starts)) fs::remove_all(entry.path());
      }
    }
  }

  static std::map<std::string, std::string> files(const fs::path& folder) {
    std::map<std::string, std::string> contents;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) {
        contents[entry.path().lexically_relative(folder)] = manifests::read_file(entry.path());
      }
    }
    return contents;
  }

  std::size_t journal_lines(const std::string& out) const {
    std::size_t lines = 0;
    const fs::path stages = scratch_.path() / out / "stages";
    if (!fs::exists(stages)) return 0;
    for (const auto& entry : fs::recursive_directory_iterator(stages)) {
      if (entry.path().filename() != "journal.jsonl") continue;
      const std::string text = manifests::read_file(entry.path());
      lines += static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
    }
    return lines;
  }

  testing::ScratchDir scratch_;
  q3d::testing::Told told_log_;
  std::vector<std::string>& told_ = told_log_.warnings;
};

}  // namespace q3d::pipeline::build
