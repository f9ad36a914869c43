#include "loaders/curation/source_labels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <stdexcept>
#include <vector>

#include "loaders/curation/clip.h"
#include "loaders/species/species.h"
#include "manifests/json_file.h"

namespace q3d::loaders::curation {
namespace {

using nlohmann::json;

struct SourcePicture {
  std::string name;
  std::string video;  // of `video_id`; empty when there is none
  std::set<std::string> species;
};

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& place, const std::string& got,
                       const std::string& expected) {
  throw std::runtime_error(fmt::format("{}: {}: got {}, expected {}", file.string(), place, got, expected));
}

// Returns the value of a key, or null if the object lacks it or is not an object.
const json& value_of(const json& object, const char* key) {
  static const json kNull;
  if (!object.is_object()) return kNull;
  const auto found = object.find(key);
  return found == object.end() ? kNull : *found;
}

// Returns an id as text. Files write it as a number or, if it is a key, as a text.
std::string id_of(const json& value, const std::filesystem::path& file, const std::string& place) {
  if (value.is_number_integer()) return std::to_string(value.get<std::int64_t>());
  if (value.is_string()) return value.get<std::string>();
  fail(file, place, manifests::describe(value), "a whole number or a text");
}

std::map<std::string, SourcePicture> read_images(const json& document, const std::filesystem::path& file) {
  std::map<std::string, SourcePicture> pictures;
  const json& images = value_of(document, "images");
  if (images.is_object()) {
    for (const auto& [id, name] : images.items()) {
      if (!name.is_string())
        fail(file, fmt::format("images: {}", id), manifests::describe(name), "a file name");
      pictures[id].name = name.get<std::string>();
    }
    return pictures;
  }
  std::size_t index = 0;
  for (const json& image : manifests::array_of(document, "images", file)) {
    const std::string place = fmt::format("images[{}]", index++);
    const json& name = value_of(image, "file_name");
    if (!name.is_string()) fail(file, place + ": file_name", manifests::describe(name), "a file name");
    SourcePicture& picture = pictures[id_of(value_of(image, "id"), file, place + ": id")];
    picture.name = name.get<std::string>();
    const json& video = value_of(image, "video_id");
    if (!video.is_null()) picture.video = "video " + id_of(video, file, place + ": video_id");
  }
  return pictures;
}

std::map<std::string, std::string> read_categories(const json& document, const std::filesystem::path& file) {
  std::map<std::string, std::string> names;
  std::size_t index = 0;
  for (const json& category : manifests::array_of(document, "categories", file)) {
    const std::string place = fmt::format("categories[{}]", index++);
    const json& name = value_of(category, "name");
    if (!name.is_string()) fail(file, place + ": name", manifests::describe(name), "the name of a species");
    names[id_of(value_of(category, "id"), file, place + ": id")] =
        species::normalised_species(name.get<std::string>());
  }
  return names;
}

// An annotation whose picture or category is not listed in the file tells nothing.
void read_species(const json& document, const std::filesystem::path& file,
                  std::map<std::string, SourcePicture>& pictures) {
  const std::map<std::string, std::string> categories = read_categories(document, file);
  std::size_t index = 0;
  for (const json& annotation : manifests::array_of(document, "annotations", file)) {
    const std::string place = fmt::format("annotations[{}]", index++);
    const auto picture = pictures.find(id_of(value_of(annotation, "image_id"), file, place + ": image_id"));
    const auto category =
        categories.find(id_of(value_of(annotation, "category_id"), file, place + ": category_id"));
    if (picture != pictures.end() && category != categories.end()) {
      picture->second.species.insert(category->second);
    }
  }
}

std::string folder_of(const std::string& name) {
  return name.substr(0, name.find_last_of("/\\") + 1);  // npos + 1 = 0
}

std::string stem_of(std::string_view name) {
  std::string stem(name.substr(name.find_last_of("/\\") + 1));
  stem.resize(std::min(stem.rfind('.'), stem.size()));
  return stem;
}

}  // namespace

void SourceLabels::add(const std::filesystem::path& file) {
  const json document = manifests::read_json_file(file);
  std::map<std::string, SourcePicture> pictures = read_images(document, file);
  read_species(document, file, pictures);
  std::set<std::string> folders;
  for (const auto& [id, picture] : pictures) folders.insert(folder_of(picture.name));
  for (const auto& [id, picture] : pictures) {
    SourceLabel label;
    if (picture.species.size() == 1) label.species = *picture.species.begin();
    label.clip = picture.video;
    if (label.clip.empty() && folders.size() > 1) label.clip = folder_of(picture.name);
    const auto [known, is_new] = labels_.emplace(stem_of(picture.name), label);
    if (is_new) continue;
    if (known->second.species != label.species) known->second.species.clear();
    if (known->second.clip != label.clip) known->second.clip.clear();
  }
}

std::optional<SourceLabel> SourceLabels::find(std::string_view file_name) const {
  for (const std::string& stem : {stem_of(file_name), source_stem(file_name)}) {
    const auto found = labels_.find(stem);
    if (found != labels_.end()) return found->second;
  }
  return std::nullopt;
}

}  // namespace q3d::loaders::curation
