#include "pipeline/exports/corrections.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "loaders/keypoints/name_match.h"
#include "loaders/pictures/affine.h"
#include "manifests/atomic_file.h"
#include "manifests/json_file.h"

namespace q3d::pipeline::exports {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kUnmovedPx = 0.01;
constexpr std::size_t kKeypoints = manifests::kNumKeypoints;

struct Point {
  double x = 0.0;
  double y = 0.0;
  int v = 0;
};
using Points = std::array<Point, kKeypoints>;

struct Picture {
  std::string id;  // id of the sample, from the export's own file
  loaders::pictures::Affine from_image{};
  std::vector<const json*> annotations;
};

struct CocoFile {
  fs::path path;
  json document;
  std::map<std::string, Picture> pictures;  // by file name without folders
  std::vector<std::size_t> order;           // place in the file of each of the 26 keypoints
};

[[noreturn]] void fail(const fs::path& file, const std::string& what) {
  throw std::runtime_error(fmt::format("{}: {}", file.string(), what));
}

std::vector<std::size_t> order_of(const CocoFile& file) {
  const auto& topology = loaders::keypoints::topology("animal3d26");
  for (const json& category : manifests::array_of(file.document, "categories", file.path)) {
    const auto names = category.value("keypoints", std::vector<std::string>());
    if (names.empty()) continue;
    try {
      const loaders::keypoints::NameMatch match = loaders::keypoints::match_names(topology, names);
      if (!match.missing.empty()) {
        fail(file.path, fmt::format("categories: keypoints: {} is missing, expected the 26 of the export",
                                    match.missing.front()));
      }
      return {match.places.begin(), match.places.end()};
    } catch (const std::invalid_argument& error) {
      fail(file.path, fmt::format("categories: keypoints: {}", error.what()));
    }
  }
  fail(file.path, "categories: got none that names its keypoints, expected the 26 of the export");
}

std::int64_t id_of(const CocoFile& file, const char* place, const json& id) {
  if (id.is_number_integer()) return id.get<std::int64_t>();
  fail(file.path, fmt::format("{}: got {}, expected a whole number", place, id.dump()));
}

// Reads a sample id. It must fit into a line of a list whose parts are separated by tabs.
std::string sample_id_of(const CocoFile& file, const json& id) {
  auto text = id.get<std::string>();
  if (std::none_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
    return text;
  fail(file.path, fmt::format("images: quadruped3d: id: got {}, expected a text of one line", id.dump()));
}

// Reads an affine map. Throws as `fail` does if it has no inverse.
loaders::pictures::Affine affine_of(const CocoFile& file, const json& numbers) {
  const auto affine = numbers.get<loaders::pictures::Affine>();
  try {
    loaders::pictures::invert(affine);
    return affine;
  } catch (const std::invalid_argument& error) {
    fail(file.path, fmt::format("images: quadruped3d: picture_from_image: {}", error.what()));
  }
}

void index_pictures(CocoFile& file) {
  std::map<std::int64_t, Picture*> by_id;
  for (const json& image : manifests::array_of(file.document, "images", file.path)) {
    const std::string name = fs::path(image.at("file_name").get<std::string>()).filename().string();
    const auto [at, is_new] = file.pictures.try_emplace(name);
    if (!is_new) {
      fail(file.path, fmt::format("images: got the file name {} twice, expected one picture for each sample "
                                  "(export with pictures)",
                                  name));
    }
    by_id[id_of(file, "images: id", image.at("id"))] = &at->second;
    if (!image.contains("quadruped3d")) continue;
    at->second.id = sample_id_of(file, image.at("quadruped3d").at("id"));
    at->second.from_image = affine_of(file, image.at("quadruped3d").at("picture_from_image"));
  }
  for (const json& annotation : manifests::array_of(file.document, "annotations", file.path)) {
    const auto found = by_id.find(id_of(file, "annotations: image_id", annotation.at("image_id")));
    if (found == by_id.end()) {
      fail(file.path, fmt::format("annotations: got image_id {}, expected an id of `images`",
                                  annotation.at("image_id").dump()));
    }
    found->second->annotations.push_back(&annotation);
  }
}

// Fills `file`. The index holds pointers into it, so it must not move.
void read_coco(const fs::path& path, CocoFile& file) {
  file.path = path;
  file.document = manifests::read_json_file(path);
  try {
    file.order = order_of(file);
    index_pictures(file);
  } catch (const json::exception& error) {
    fail(path, fmt::format("not COCO keypoints: {}", error.what()));
  }
}

Points points_of(const CocoFile& file, const json& annotation) {
  const auto numbers = annotation.at("keypoints").get<std::vector<double>>();
  if (numbers.size() != 3 * kKeypoints) {
    fail(file.path, fmt::format("annotation {}: got {} numbers in keypoints, expected {}",
                                annotation.value("id", json()).dump(), numbers.size(), 3 * kKeypoints));
  }
  Points points;
  for (std::size_t k = 0; k < kKeypoints; ++k) {
    const double* at = &numbers[3 * file.order[k]];
    if (!(at[2] == 0.0 || at[2] == 1.0 || at[2] == 2.0)) {
      fail(file.path, fmt::format("annotation {}: got v = {}, expected 0, 1 or 2",
                                  annotation.value("id", json()).dump(), at[2]));
    }
    points[k] = {at[0], at[1], static_cast<int>(at[2])};
  }
  return points;
}

bool is_vetoed(const json& annotation) {
  const auto attributes = annotation.find("attributes");
  if (attributes == annotation.end() || !attributes->is_object()) return false;
  const json veto = attributes->value("veto", json(false));
  return veto == json(true) || veto == json("true") || veto == json("True");  // tools write either
}

bool has_changed(const Point& before, const Point& after) {
  if (before.v != after.v) return true;
  return after.v > 0 &&
         (std::abs(before.x - after.x) > kUnmovedPx || std::abs(before.y - after.y) > kUnmovedPx);
}

// Returns the points that changed. Throws std::out_of_range if a point has no finite position in the source
// picture.
std::vector<candidates::CorrectedPoint> changed_points(const Points& before, const Points& after,
                                                       const loaders::pictures::Affine& image_from_picture) {
  std::vector<candidates::CorrectedPoint> changed;
  for (std::size_t k = 0; k < kKeypoints; ++k) {
    if (!has_changed(before[k], after[k])) continue;
    const auto at = loaders::pictures::map_point(image_from_picture, {after[k].x, after[k].y});
    if (after[k].v > 0 && !(std::isfinite(at.x) && std::isfinite(at.y))) {
      throw std::out_of_range(
          fmt::format("got a keypoint at ({}, {}), expected one near the picture", after[k].x, after[k].y));
    }
    changed.push_back({k, after[k].v > 0 ? at.x : 0.0, after[k].v > 0 ? at.y : 0.0, after[k].v});
  }
  return changed;
}

}  // namespace

CocoChanges coco_changes(const fs::path& export_folder, const fs::path& corrected) {
  CocoFile before;
  CocoFile after;
  read_coco(export_folder / "annotations.json", before);
  read_coco(corrected, after);
  CocoChanges changes;
  for (const auto& [name, picture] : after.pictures) {
    const auto found = before.pictures.find(name);
    if (found == before.pictures.end()) {
      fail(corrected, fmt::format("images: got {}, expected a picture of {}", name, before.path.string()));
    }
    ++changes.pictures;
    const Picture& exported = found->second;
    if (picture.annotations.empty()) {
      changes.vetoes[exported.id] =
          fmt::format("its annotation was removed in {}", corrected.filename().string());
      continue;
    }
    if (picture.annotations.size() > 1 || exported.annotations.size() != 1) {
      fail(corrected,
           fmt::format("{}: got {} annotations, expected one, since each exported picture shows one sample",
                       name, picture.annotations.size()));
    }
    try {
      if (is_vetoed(*picture.annotations.front())) {
        changes.vetoes[exported.id] = fmt::format("marked in {}", corrected.filename().string());
        continue;
      }
      auto points = changed_points(points_of(before, *exported.annotations.front()),
                                   points_of(after, *picture.annotations.front()),
                                   loaders::pictures::invert(exported.from_image));
      if (!points.empty()) changes.points[exported.id] = std::move(points);
    } catch (const json::exception& error) {
      fail(corrected, fmt::format("{}: {}", name, error.what()));
    } catch (const std::out_of_range& error) {
      fail(corrected, fmt::format("{}: {}", name, error.what()));
    }
  }
  return changes;
}

void write_changes(const CocoChanges& changes, const fs::path& folder) {
  fs::create_directories(folder);
  std::string veto = "# sample id, why: for `quadruped3d build --veto`\n";
  for (const auto& [id, why] : changes.vetoes) veto += id + "\t" + why + "\n";
  manifests::write_file_atomically(folder / "corrections.tsv", candidates::corrections_text(changes.points));
  manifests::write_file_atomically(folder / "veto.txt", veto);
}

}  // namespace q3d::pipeline::exports
