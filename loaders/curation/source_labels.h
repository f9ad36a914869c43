// What a sub-dataset's own annotation files tell of its pictures, where their names in a collection do not:
// species and video.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

namespace q3d::loaders::curation {

struct SourceLabel {
  std::string species;  // empty where the picture's animals are of several
  std::string clip;     // empty where the file tells of no video
  bool operator==(const SourceLabel&) const = default;
};

// Pictures by the stem of their file name.
class SourceLabels {
 public:
  // Adds a COCO-style file: `images` (a list, or an object from id to file name as AnimalPose has it),
  // `annotations` with category_id, and `categories`. A picture's species is its annotations' category; its
  // video is `video_id`, else the folder of its name where the pictures lie in more than one. Stems that two
  // pictures share keep what both agree on. Throws std::runtime_error naming file, got and expected.
  void add(const std::filesystem::path& file);

  // Of a picture as a collection names it: by its stem, or by that without the image id that SuperAnimal
  // appends. Nothing for a picture that no file lists.
  std::optional<SourceLabel> find(std::string_view file_name) const;

  std::size_t size() const { return labels_.size(); }

 private:
  std::unordered_map<std::string, SourceLabel> labels_;
};

}  // namespace q3d::loaders::curation
