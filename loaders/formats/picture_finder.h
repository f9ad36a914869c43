// From a picture's name in an annotation file to a file below the dataset's root.
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
  std::filesystem::path path;  // absolute, links resolved; empty when it failed
  manifests::Reason failure = manifests::Reason::none;
  std::string got;  // for people: what the name led to
};

// Looks names up in the folder of pictures and in the root:
// - a relative name as it is; climbing out by ".." fails;
// - an absolute name inside the root as it is; one of the author's own disk by its last components, the most
// of
//   them that name a file here (the base name alone where the pictures lie in one flat folder);
// - failing that, the same without regard to letter case, '+' for a space, and .jpeg for .jpg.
// Where several files match, none is taken. Symbolic links must not lead out of the root, nor out of the
// folder of pictures where the user named one.
class PictureFinder {
 public:
  // `images` is relative to root unless absolute; empty means `default_images` where root has such a folder,
  // else root. Throws std::runtime_error when a folder is not there.
  PictureFinder(const std::filesystem::path& root, const std::filesystem::path& images,
                const std::filesystem::path& default_images);

  FoundPicture find(const std::string& name);

  std::size_t found_by_tail() const { return found_by_tail_; }          // absolute names of another disk
  std::size_t found_by_spelling() const { return found_by_spelling_; }  // case, '+', .jpeg
  std::size_t shared_files() const {
    return shared_files_;
  }  // other names that led to a file already found so

 private:
  std::optional<FoundPicture> existing(const std::filesystem::path& path);
  std::optional<FoundPicture> below_bases(const std::filesystem::path& relative);
  std::optional<FoundPicture> by_spelling(const std::filesystem::path& relative);
  FoundPicture find_absolute(const std::filesystem::path& name);
  FoundPicture find_relative(const std::filesystem::path& name);
  bool is_allowed(const std::filesystem::path& resolved) const;

  std::vector<std::filesystem::path> bases_;    // resolved folders to look in, in this order
  std::vector<std::filesystem::path> allowed_;  // resolved folders that pictures may lie in
  std::string images_name_;                     // last component of the pictures' folder
  // Folded relative path -> the files spelled so; filled when first needed.
  std::optional<std::unordered_map<std::string, std::vector<std::filesystem::path>>> spellings_;
  std::unordered_map<std::string, std::filesystem::path> resolved_folders_;
  std::size_t found_by_tail_ = 0;
  std::size_t found_by_spelling_ = 0;
  std::unordered_map<std::string, std::string>
      name_of_tail_;  // file found by a tail -> the first name that led to it
  std::size_t shared_files_ = 0;
};

// The name as it goes into a sample id: relative to the root, without "." and "..", on one line; the base
// name where the file gives an absolute name or climbs out.
std::string id_part(std::string_view name);

}  // namespace q3d::loaders::formats
