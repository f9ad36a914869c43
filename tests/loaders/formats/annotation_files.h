// Small annotation files and pictures that the loader tests write for themselves.
#pragma once

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "loaders/formats/dataset.h"
#include "loaders/keypoints/topology.h"
#include "tests/support/paths.h"

namespace q3d::loaders::formats::testing_files {

using nlohmann::json;

inline void write_text(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

inline void write_picture(const std::filesystem::path& path, int width = 64, int height = 48) {
  std::filesystem::create_directories(path.parent_path());
  std::vector<unsigned char> png;
  cv::imencode(".png", cv::Mat(height, width, CV_8UC3, cv::Scalar(10, 120, 230)), png);
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
}

// `count` points along a diagonal, inside (10, 10)..(40, 30), all labelled.
inline json keypoint_rows(std::size_t count) {
  json rows = json::array();
  for (std::size_t i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(count - 1);
    rows.push_back({10.0 + 30.0 * t, 10.0 + 20.0 * t, 1.0});
  }
  return rows;
}

inline json flat(const json& rows) {
  json numbers = json::array();
  for (const auto& row : rows) numbers.insert(numbers.end(), row.begin(), row.end());
  return numbers;
}

// A record that has every field of PRIMA's JSON.
inline json prima_record(const std::string& picture = "images/train/horse/000000000001_horse.png") {
  return {{"img_path", picture},
          {"mask_path", "masks/one.png"},
          {"bbox", {8, 8, 36, 26}},
          {"width", 64},
          {"height", 48},
          {"keypoint_2d", keypoint_rows(26)},
          {"keypoint_3d", keypoint_rows(26)},
          {"pose", std::vector<double>(105, 0.1)},
          {"shape", std::vector<double>(20, 0.2)},
          {"shape_extra", std::vector<double>(21, 0.3)},
          {"trans", {0.1, 0.2, 5.0}},
          {"supercategory", 2}};
}

inline json superanimal_document(std::size_t annotations = 1) {
  json document{{"images", json::array()}, {"annotations", json::array()}};
  document["categories"] = {{{"id", 1},
                             {"name", "superquadruped"},
                             {"keypoints", keypoints::topology("superanimal_quadruped39").keypoints}}};
  for (std::size_t i = 0; i < annotations; ++i) {
    document["images"].push_back({{"id", 100 + i},
                                  {"file_name", "horse_11361_" + std::to_string(i) + ".png"},
                                  {"width", 64},
                                  {"height", 48},
                                  {"source_dataset", "AwA-Pose"}});
    document["annotations"].push_back({{"id", 7 + i},
                                       {"image_id", 100 + i},
                                       {"category_id", 1},
                                       {"iscrowd", 0},
                                       {"num_keypoints", 39},
                                       {"bbox", {8, 8, 36, 26}},
                                       {"keypoints", flat(keypoint_rows(39))}});
  }
  return document;
}

inline json kingdom_record() {
  json joints = json::array();
  for (const auto& row : keypoint_rows(23)) joints.push_back({row[0], row[1]});
  return {{"image", "AAAA/AAAA_f000001.png"},
          {"animal", "Wolf"},
          {"animal_parent_class", "Mammal"},
          {"animal_class", "Mammal"},
          {"animal_subclass", "Dog / Wolf / Fox / Coyote / Jackal"},
          {"joints_vis", std::vector<int>(23, 1)},
          {"joints", joints},
          {"scale", 0.15},
          {"center", {25.0, 20.0}},
          {"Protocol 3 mammal", "test"}};
}

// A dataset folder with the pictures that the records above name.
class Folder {
 public:
  Folder() {
    write_picture(root() / "images/train/horse/000000000001_horse.png");
    for (int i = 0; i < 3; ++i)
      write_picture(root() / "images" / ("horse_11361_" + std::to_string(i) + ".png"));
    write_picture(root() / "dataset/AAAA/AAAA_f000001.png");
    write_picture(root() / "masks/one.png");
  }
  std::filesystem::path root() const { return scratch_.path() / "root"; }

  Dataset load_text(const std::string& format, const std::string& text) const {
    write_text(root() / "train.json", text);
    return load_dataset(options(format));
  }
  Dataset load(const std::string& format, const json& document) const {
    return load_text(format, document.dump());
  }
  Dataset load_prima(const std::vector<json>& records) const { return load("prima", {{"data", records}}); }

  DatasetOptions options(const std::string& format) const {
    return {.name = "set",
            .format = format,
            .split = "train",
            .root = root(),
            .annotations = "train.json",
            .images = {}};
  }

 private:
  q3d::testing::ScratchDir scratch_;
};

inline std::string joined(const std::vector<Note>& notes) {
  std::string text;
  for (const Note& note : notes) text += note.text + "\n";
  return text;
}

}  // namespace q3d::loaders::formats::testing_files
