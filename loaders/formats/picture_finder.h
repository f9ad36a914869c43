// Finds the file below the dataset's root that a picture's name in an annotation file stands for.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "manifests/sample.h"

namespace q3d::loaders::formats {

struct FoundPicture {
  std::filesystem::path path;  // absolute, with links resolved; empty if it was not found
  manifests::Reason failure = manifests::Reason::none;
  std::string got;  // for people: where the name led to
};

// Looks names up in the folder of pictures and in the root:
// - A relative name is used as it is. A name that climbs out with ".." fails.
// - An absolute name inside the root is used as it is. An absolute name from the author's own disk is looked
//   up by its last components: by the longest tail that names a file here (only the base name if the pictures
//   lie in one flat folder).
// - If this finds nothing, the same is tried without regard to letter case, with '+' for a space, and .jpeg
//   for .jpg.
// If several files match, none is taken. Symbolic links must not lead out of the root, nor out of the folder
// of pictures if the user named one.
class PictureFinder {
 public:
  // `images` is relative to root unless it is absolute. If it is empty, `default_images` is used if root has
  // such a folder, else root. Throws std::runtime_error if a folder does not exist.
  PictureFinder(const std::filesystem::path& root, const std::filesystem::path& images,
                const std::filesystem::path& default_images);

  // Throws manifests::IoError if the system does not say whether a file is there (EIO, EACCES, ...).
  FoundPicture find(const std::string& name);

  std::size_t found_by_tail() const { return found_by_tail_; }          // absolute names from another disk
  std::size_t found_by_spelling() const { return found_by_spelling_; }  // case, '+', .jpeg
  // Further names that led to a file found in this way before.
  std::size_t shared_files() const { return shared_files_; }

 private:
  std::optional<FoundPicture> existing(const std::filesystem::path& path);
  std::optional<FoundPicture> below_bases(const std::filesystem::path& relative);
  std::optional<FoundPicture> by_spelling(const std::filesystem::path& relative);
  FoundPicture find_absolute(const std::filesystem::path& name);
  FoundPicture find_relative(const std::filesystem::path& name);
  bool is_allowed(const std::filesystem::path& resolved) const;

  std::vector<std::filesystem::path> bases_;    // resolved folders that are searched, in this order
  std::vector<std::filesystem::path> allowed_;  // resolved folders that pictures may lie in
  std::string images_name_;                     // last component of the pictures' folder
  // Folded relative path -> the files with this spelling. Filled when it is first needed.
  std::optional<std::unordered_map<std::string, std::vector<std::filesystem::path>>> spellings_;
  std::unordered_map<std::string, std::filesystem::path> resolved_folders_;
  std::size_t found_by_tail_ = 0;
  std::size_t found_by_spelling_ = 0;
  std::unordered_map<std::string, std::string>
      name_of_tail_;  // file found by a tail -> the first name that led to it
  std::size_t shared_files_ = 0;
};

// Returns the name as it appears in a sample id: relative to the root, without "." and "..", on one line. If
// the file gives an absolute name or one that climbs out, it is the base name.
std::string id_part(std::string_view name);

}  // namespace q3d::loaders::formats
