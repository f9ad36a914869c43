// The label files of a DeepLabCut project.
#pragma once

#include <filesystem>
#include <vector>

#include "loaders/formats/notes.h"

namespace q3d::loaders::formats {

// Returns the labels in and below a folder: one file of CollectedData_* for each folder, its .h5 if there is
// one, else its .csv.
//
// A folder may hold labels of several scorers, or DeepLabCut's own backups: it leaves CollectedData_Ada
// beside the new file as CollectedData_Adasingleanimal when a project becomes a multi-animal one, and as
// CollectedData_Adawindows when its paths are converted. The file of the `scorer` in config.yaml is taken,
// which is looked for from the folder of the labels up to `root`. Without it, backups are left out. The notes
// name what is left out.
//
// Throws std::runtime_error if there are no labels, or if a folder has several files and none of these rules
// decides; the message names them.
std::vector<std::filesystem::path> project_label_files(const std::filesystem::path& folder,
                                                       const std::filesystem::path& root, Notes& notes);

}  // namespace q3d::loaders::formats
