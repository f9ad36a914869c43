// A survey tells what a label file says about its keypoints, before there is a topology to load it with.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace q3d::loaders::formats {

struct LabelSurvey {
  std::filesystem::path file;      // the file that was read; for a folder, its first label file
  std::string kind;                // for people: "COCO", "LabelMe", "a table of DeepLabCut's kind"
  std::string format;              // the format that loads the file (dataset_formats()); empty if none does
  std::vector<std::string> names;  // names of the keypoints, in the file's order
  std::vector<std::string> notes;
};

// Reads the names of the keypoints from a COCO or LabelMe file, from a table of DeepLabCut, SLEAP or
// Lightning Pose (.h5, .slp, .csv), or from a folder with DeepLabCut's CollectedData files or LabelMe's .json
// files. Throws std::runtime_error that names the file, what was found and what was expected. For a file that
// needs no topology, the message says so.
LabelSurvey survey_labels(const std::filesystem::path& file_or_folder);

}  // namespace q3d::loaders::formats
