// Finds the file below the dataset's root that a picture's name in an annotation file stands for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "loaders/formats/picture_name.h"
#include "manifests/path_table.h"
#include "manifests/sample.h"

namespace q3d::loaders::formats {

struct FoundPicture {
  std::filesystem::path path;  // absolute, with links resolved; empty if it was not found
  manifests::Reason failure = manifests::Reason::none;
  std::string got;  // for people: where the name led to, with paths relative to the root
};

// The folders that names count from. All of them are relative to the root unless they are absolute.
struct PictureFolders {
  std::filesystem::path root;
  std::filesystem::path images{};          // named by the user; it may lie outside the root
  std::filesystem::path default_images{};  // the format's own, used if `images` is empty and the root has it
  std::filesystem::path annotations{};     // folder of the annotation file; empty if it is not known
};

// Looks up a name in each of its readings (picture_name.h), the most literal one first:
// - A relative path counts from the folder of pictures, from the root, and then from the annotation file's
//   folder. A path that climbs out with ".." counts from the annotation file's folder first. If a path begins
//   with the name of the root or of the folder of pictures ("dogs/images/a.jpg"), what follows is looked up.
// - An absolute path inside the root is used as it is. An absolute path of another disk or server is looked
// up
//   by its last components: by the longest tail that names a file here.
// - If this finds nothing, the same is tried without regard to letter case, to the way in which accents are
//   written (Unicode NFC and NFD), with '+' for a space, and .jpeg for .jpg.
// If several files match, none is taken. Nothing outside the root is ever taken, however it is spelled,
// except below the folder of pictures if the user named one. Symbolic links must not lead out of them either.
class PictureFinder {
 public:
  // Throws std::runtime_error if the root or the named folder of pictures does not exist.
  explicit PictureFinder(const PictureFolders& folders);

  // Throws manifests::IoError if the system does not say whether a file is there (EIO, EACCES, ...).
  FoundPicture find(const std::string& name);

  // Looks for the base name of `name` in `folder`. Returns nothing if it is not there, or if the folder is
  // outside the root. Throws as find does.
  std::optional<FoundPicture> find_in(const std::filesystem::path& folder, const std::string& name);

  // Returns the path relative to the root; empty if it lies outside.
  std::filesystem::path relative_to_root(const std::filesystem::path& path) const;

  std::size_t found_by_tail() const { return found_by_tail_; }        // absolute names from elsewhere
  std::size_t found_by_reading() const { return found_by_reading_; }  // backslashes, %20, "../", root's name
  std::size_t found_by_spelling() const { return found_by_spelling_; }  // case, accents, '+', .jpeg
  // Returns how many further names led to a file that was already found by its tail.
  std::size_t shared_files() const { return shared_files_; }

 private:
  using Spellings = std::unordered_map<std::string, std::vector<std::filesystem::path>>;

  std::optional<FoundPicture> existing(const std::filesystem::path& path);
  std::optional<FoundPicture> below_bases(const std::filesystem::path& relative);
  std::optional<FoundPicture> by_spelling(const std::filesystem::path& relative);
  std::optional<FoundPicture> find_exactly(const NameReading& reading);
  std::optional<FoundPicture> find_absolute(const NameReading& reading);
  std::optional<FoundPicture> find_climbing(const std::filesystem::path& path);
  std::vector<std::filesystem::path> own_tails(const std::filesystem::path& path) const;
  std::optional<FoundPicture> find_by_spelling(const NameReading& reading);
  FoundPicture not_found(const std::vector<NameReading>& readings) const;
  const Spellings& spellings_below(const std::filesystem::path& base);
  std::string name_for_people(const std::filesystem::path& path) const;
  bool lies_in_allowed(const std::filesystem::path& path) const;

  std::filesystem::path root_;
  std::vector<std::filesystem::path> bases_;    // folders that relative names count from, in order
  std::vector<std::filesystem::path> allowed_;  // folders that pictures may lie in
  std::filesystem::path annotations_;  // folder of the annotation file; empty if it lies outside allowed_
  std::unordered_map<std::string, std::filesystem::path> resolved_folders_;
  std::map<std::filesystem::path, Spellings> spellings_;  // of a base folder: folded name -> files
  std::size_t found_by_tail_ = 0;
  std::size_t found_by_reading_ = 0;
  std::size_t found_by_spelling_ = 0;
  manifests::PathTable files_of_tails_;     // files that were found by their tails
  std::vector<std::uint64_t> first_names_;  // by the file's number: hash of the first name that led to it
  std::size_t shared_files_ = 0;
};

}  // namespace q3d::loaders::formats
