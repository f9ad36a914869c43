#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "loaders/formats/sleap.h"

namespace q3d::loaders::formats {
namespace {

// A table has columns for every individual. With more tracks than this, individuals are numbered within their
// frame instead. Trackers make many tracks of a long video, because they lose animals and find them again.
constexpr std::size_t kMostTracks = 64;
// The largest size of a table: x, y and likelihood of every node of every individual of every frame.
constexpr std::size_t kMostNumbers = std::size_t{1} << 28U;

// Returns the name of an individual. It becomes part of sample ids, and it must not be "single", with which
// DeepLabCut's tables mean no animal.
std::string individual_name(std::string name, std::size_t track, bool is_shared) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c == '/' || c == '#' || c == '\\'; },
      '_');
  if (name.empty() || name == "single" || is_shared) name += fmt::format("_{}", track);
  return name;
}

}  // namespace

SleapTable::SleapTable(std::vector<std::string> nodes, const std::vector<std::string>& tracks)
    : nodes_(std::move(nodes)) {
  if (tracks.size() > kMostTracks) return;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const bool is_shared = std::count(tracks.begin(), tracks.end(), tracks[i]) > 1;
    tracks_.push_back(individual_name(tracks[i], i, is_shared));
  }
}

void SleapTable::begin_frame(std::string name, std::size_t video) {
  rows_.push_back({std::move(name), video});
  in_frame_.clear();
}

std::size_t SleapTable::individual_named(const std::string& name) {
  const auto found = std::find(individuals_.begin(), individuals_.end(), name);
  if (found != individuals_.end()) return static_cast<std::size_t>(found - individuals_.begin());
  individuals_.push_back(name);
  return individuals_.size() - 1;
}

std::size_t SleapTable::individual_of(std::optional<std::size_t> track) {
  const auto is_free = [&](std::size_t individual) {
    return std::find(in_frame_.begin(), in_frame_.end(), individual) == in_frame_.end();
  };
  if (track && *track < tracks_.size()) {
    const std::size_t individual = individual_named(tracks_[*track]);
    if (is_free(individual)) return individual;
  }
  for (std::size_t number = 0;; ++number) {
    const std::size_t individual = individual_named(fmt::format("animal_{}", number));
    if (is_free(individual)) return individual;
  }
}

void SleapTable::add_animal(std::optional<std::size_t> track, const std::vector<Point>& points) {
  const bool is_labelled =
      std::any_of(points.begin(), points.end(), [](const Point& point) { return !std::isnan(point.x_px); });
  if (!is_labelled) return;
  const std::size_t individual = individual_of(track);
  in_frame_.push_back(individual);
  animals_.push_back({rows_.size() - 1, individual, points});
}

LabelTable SleapTable::finish(bool rows_are_numbers, std::vector<LabelVideo> videos) const {
  LabelTable table;
  table.rows_are_numbers = rows_are_numbers;
  table.videos = std::move(videos);
  const bool is_single = individuals_.size() == 1;
  for (const std::string& individual : individuals_) {
    for (const std::string& node : nodes_) {
      for (const char* coordinate : {"x", "y", "likelihood"})
        table.columns.push_back({"SLEAP", is_single ? std::string() : individual, node, coordinate});
    }
  }
  std::vector<std::size_t> row_of_frame(rows_.size(), 0);
  for (const Animal& animal : animals_) {
    // The animals are in the order of their frames.
    const bool is_new = &animal == animals_.data() || (&animal - 1)->row != animal.row;
    if (is_new) table.rows.push_back(rows_[animal.row].name);
    if (is_new && !table.videos.empty()) table.video_of_row.push_back(rows_[animal.row].video);
    row_of_frame[animal.row] = table.rows.size() - 1;
  }
  if (!table.columns.empty() && table.rows.size() > kMostNumbers / table.columns.size()) {
    throw std::runtime_error(fmt::format(
        "got {} frames of {} animals and {} nodes, expected at most {} numbers in all; export fewer frames",
        table.rows.size(), individuals_.size(), nodes_.size(), kMostNumbers));
  }
  const std::size_t width = table.columns.size();
  table.values.assign(table.rows.size() * width, std::numeric_limits<double>::quiet_NaN());
  for (const Animal& animal : animals_) {
    double* to = &table.values[row_of_frame[animal.row] * width + animal.individual * nodes_.size() * 3];
    for (const Point& point : animal.points) {
      *to++ = point.x_px;
      *to++ = point.y_px;
      *to++ = std::isnan(point.x_px) ? std::numeric_limits<double>::quiet_NaN()
                                     : std::clamp(point.likelihood, 0.0, 1.0);
    }
  }
  return table;
}

}  // namespace q3d::loaders::formats
