// Keeps perceptual hashes of pictures on disk, computed once for each content.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "manifests/picture_hash.h"

namespace q3d::pipeline::leakage {

struct PictureFile {
  std::string path;
  std::string sha256;
  int orientation = 1;  // EXIF orientation by which the dataset turns the picture

  // Returns the key of the remembered hash: the SHA-256, and the orientation if it turns the picture.
  std::string key() const;
};

// Remembers hashes by the pictures' keys in one file of checked lines, which grows while pictures are hashed.
// A run that is stopped loses at most the last few thousand.
class PictureHashes {
 public:
  // Loads the file if it exists; a damaged line is dropped. Throws std::runtime_error if it cannot be read.
  explicit PictureHashes(std::filesystem::path file);

  // Hashes, in parallel, the pictures that are not known yet, and appends the hashes to the file. A picture
  // that cannot be decoded, or is one colour, has no hash. Throws std::runtime_error for one that is gone,
  // manifests::IoError for one that cannot be read, Interrupted.
  void add(const std::vector<PictureFile>& pictures, bool quiet);

  std::optional<manifests::PictureHash> find(const std::string& key) const;

 private:
  void append(const std::vector<const PictureFile*>& pictures) const;

  std::filesystem::path file_;
  std::map<std::string, std::optional<manifests::PictureHash>> hashes_;  // by key
};

}  // namespace q3d::pipeline::leakage
