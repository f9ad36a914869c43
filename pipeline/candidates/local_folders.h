// Takes the folders of this machine out of what is said of a dataset.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "loaders/formats/dataset.h"

namespace q3d::pipeline::candidates {

// Verdicts and notes are part of a dataset, and equal builds in different folders must have equal ones. So
// they name files relative to the dataset's folders: its root, the folder of pictures and the folder of the
// annotation file. Each of them counts as the options give it, and with its links resolved.
class LocalFolders {
 public:
  // A folder that is not there is left out.
  explicit LocalFolders(const loaders::formats::DatasetOptions& options);

  // Returns the text with every path below one of the folders made relative to it. The path of a folder
  // itself becomes its name: "the root".
  std::string without(std::string text) const;

 private:
  struct Folder {
    std::string path;  // without a '/' at its end
    std::string name;  // empty: the folder is not named without what follows it
  };
  void add(const std::filesystem::path& folder, const std::string& name);
  void add_path(const std::filesystem::path& folder, const std::string& name);
  static std::size_t replace_at(std::size_t at, const Folder& folder, std::string& text);

  std::vector<Folder> folders_;  // in the order in which they are looked for
};

}  // namespace q3d::pipeline::candidates
