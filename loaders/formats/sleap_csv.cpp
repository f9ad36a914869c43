// Reads SLEAP's analysis export as CSV. It has a line for each animal in each frame,
// "track,frame_idx,instance.score," and then x, y and score of every node, as "nose.x,nose.y,nose.score".
// Other columns are ignored.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>

#include "loaders/formats/sleap.h"
#include "manifests/csv.h"

namespace q3d::loaders::formats {
namespace {

using manifests::CsvTableReader;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::vector<std::string> header_of(const std::string& text, const std::string& where) {
  manifests::CsvReader lines(text, where);
  std::vector<std::string> cells;
  lines.next(cells);
  return cells;
}

// Returns the nodes' names, in the order of their x columns.
std::vector<std::string> nodes_of(const std::vector<std::string>& header) {
  std::vector<std::string> nodes;
  for (const std::string& name : header) {
    const bool has_y =
        name.ends_with(".x") &&
        std::find(header.begin(), header.end(), name.substr(0, name.size() - 1) + "y") != header.end();
    if (has_y) nodes.push_back(name.substr(0, name.size() - 2));
  }
  return nodes;
}

struct NodeColumns {
  std::size_t x;
  std::size_t y;
  std::optional<std::size_t> score;
};

struct Row {
  std::optional<std::string> track;
  std::vector<SleapTable::Point> points;
};

// Throws if the table has frames of several videos, which sleap-io writes into one table.
void require_one_video(const CsvTableReader& lines, const std::string& here, std::string& video) {
  if (video.empty()) video = here;
  if (here == video) return;
  lines.fail(
      fmt::format("frames of both {} and {}", video, here),
      "the frames of one video, because those of several have the same numbers; export each video into a "
      "file of its own");
}

}  // namespace

bool is_sleap_csv(const std::string& text) {
  const std::string line = text.substr(0, text.find('\n'));
  return line.find("frame_idx") != std::string::npos && line.find(".x") != std::string::npos;
}

LabelTable read_sleap_csv(const std::string& text, const std::string& where) {
  const std::vector<std::string> header = header_of(text, where);
  const std::vector<std::string> nodes = nodes_of(header);
  if (nodes.empty()) {
    throw std::runtime_error(
        fmt::format("{}: line 1: got no pair of columns such as nose.x and nose.y, expected those of SLEAP's "
                    "analysis CSV",
                    where));
  }
  CsvTableReader lines(text, where);
  const auto has = [&](const std::string& name) {
    return std::find(header.begin(), header.end(), name) != header.end();
  };
  std::vector<NodeColumns> columns;
  for (const std::string& node : nodes) {
    columns.push_back({lines.column(node + ".x"), lines.column(node + ".y"), {}});
    if (has(node + ".score")) columns.back().score = lines.column(node + ".score");
  }
  const std::size_t frame_column = lines.column("frame_idx");
  std::string video;
  std::map<std::int64_t, std::vector<Row>> frames;
  std::vector<std::string> tracks;
  while (lines.next()) {
    if (has("video_path")) require_one_video(lines, lines.cell(lines.column("video_path")), video);
    Row row;
    if (has("track") && !lines.cell(lines.column("track")).empty()) {
      row.track = lines.cell(lines.column("track"));
      if (std::find(tracks.begin(), tracks.end(), *row.track) == tracks.end()) tracks.push_back(*row.track);
    }
    for (const NodeColumns& node : columns) {
      SleapTable::Point point{lines.number(node.x).value_or(kNaN), lines.number(node.y).value_or(kNaN), 1.0};
      if (std::isnan(point.y_px)) point.x_px = kNaN;
      if (node.score) point.likelihood = lines.number(*node.score).value_or(1.0);
      row.points.push_back(point);
    }
    const auto frame = lines.number(frame_column);
    if (!frame || *frame != std::floor(*frame) || *frame < 0.0) {
      throw std::runtime_error(fmt::format("{}: frame_idx: got \"{}\", expected the number of a frame", where,
                                           lines.cell(frame_column)));
    }
    frames[static_cast<std::int64_t>(*frame)].push_back(std::move(row));
  }
  SleapTable table(nodes, tracks);
  for (const auto& [number, rows] : frames) {
    table.begin_frame(std::to_string(number));
    for (const Row& row : rows) {
      const auto found = row.track ? std::find(tracks.begin(), tracks.end(), *row.track) : tracks.end();
      table.add_animal(found == tracks.end()
                           ? std::nullopt
                           : std::optional(static_cast<std::size_t>(found - tracks.begin())),
                       row.points);
    }
  }
  return table.finish(/*rows_are_numbers=*/true);
}

}  // namespace q3d::loaders::formats
