// Reads species and videos of pictures from a sub-dataset's own annotation files. This is for pictures whose
// names in a collection do not tell species and video.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

namespace q3d::loaders::curation {

struct SourceLabel {
  std::string species;  // empty if the picture shows animals of several species
  std::string clip;     // empty if the file names no video
  bool operator==(const SourceLabel&) const = default;
};

// The labels of pictures, by the stem of their file name.
class SourceLabels {
 public:
  // Adds a COCO-style file with `images` (a list, or an object from id to file name as in AnimalPose),
  // `annotations` with category_id, and `categories`. A picture's species is the category of its annotations.
  // Its video is `video_id`; without one, it is the folder of its name if the pictures lie in more than one
  // folder. If two pictures have the same stem, only what both agree on is kept. Throws std::runtime_error
  // that names the file, what was found and what was expected.
  void add(const std::filesystem::path& file);

  // Returns the label of a picture as a collection names it. It is searched by its stem, then by its stem
  // without the image id that SuperAnimal appends. Returns nothing for a picture that no file lists.
  std::optional<SourceLabel> find(std::string_view file_name) const;

  std::size_t size() const { return labels_.size(); }

 private:
  std::unordered_map<std::string, SourceLabel> labels_;
};

}  // namespace q3d::loaders::curation
