// Collects what a person changed in an exported COCO file, for the next build.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/candidates/corrections.h"

namespace q3d::pipeline::exports {

struct CocoChanges {
  std::map<std::string, std::vector<candidates::CorrectedPoint>> points;  // by sample id
  std::map<std::string, std::string> vetoes;                              // sample id -> reason
  std::size_t pictures = 0;                                               // pictures that both files list
};

// Compares annotations.json of an exported folder with the file that came back from an annotation tool.
//
// Pictures are matched by their file names without folders, because tools give their own ids. A picture that
// the file does not list is unchanged. One that it lists without an annotation is vetoed, and so is one whose
// annotation has the attribute "veto": true. Keypoints are matched by their names; one counts as changed if
// it moved by more than 0.01 px, because tools round to that, or if its v differs. Points come in px of the
// source picture.
//
// Throws std::runtime_error that names the file, what was found and what was expected: for files that cannot
// be read, a picture that the export lacks or that has several annotations, and keypoints of other names.
CocoChanges coco_changes(const std::filesystem::path& export_folder, const std::filesystem::path& corrected);

// Writes corrections.tsv and veto.txt, for the build's options --corrections and --veto.
void write_changes(const CocoChanges& changes, const std::filesystem::path& folder);

}  // namespace q3d::pipeline::exports
