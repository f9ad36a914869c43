// `topology`: drafts a topology for a lab's labels, and draws a picture with which people check it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "loaders/formats/label_survey.h"
#include "loaders/formats/note.h"
#include "loaders/keypoints/guess.h"

namespace q3d::pipeline::topology {

struct DraftOptions {
  std::filesystem::path from;  // a label file, or a folder of labels (survey_labels)
  std::string name;            // name of the topology; empty takes the file's
  std::filesystem::path out;   // the topology file to write; empty writes none
  bool replaces = false;       // whether an existing file may be overwritten
};

struct Draft {
  loaders::formats::LabelSurvey survey;
  loaders::keypoints::TopologyGuess guess;
  std::string text;  // the topology file
  // The folder below the labels' folder that holds most pictures; empty if the labels' folder itself does.
  std::filesystem::path images{};
};

// Reads the names of the keypoints, guesses a topology and writes it. Throws ConfigError, before anything is
// read, if the file to write exists and may not be overwritten. Also throws as survey_labels does.
Draft draft_topology(const DraftOptions& options);

struct SheetOptions {
  std::filesystem::path labels;    // a label file, or a folder of labels
  std::filesystem::path topology;  // a topology file, or the name of a built-in one
  std::filesystem::path root;      // pictures are looked up below it; empty takes the labels' folder
  std::filesystem::path images;    // folder of the pictures, relative to root; empty as in a config
  std::filesystem::path sheet;     // PNG to write
  int count = 6;                   // animals, evenly spaced over the file
};

// Loads the labels as a build does, draws the mapped keypoints of a few animals into their pictures, and
// returns the loader's notes. Throws ConfigError if no format loads the file, and std::runtime_error if no
// animal has a picture and a keypoint; the message has the first record's reason.
std::vector<loaders::formats::Note> draw_label_sheet(const SheetOptions& options);

}  // namespace q3d::pipeline::topology
