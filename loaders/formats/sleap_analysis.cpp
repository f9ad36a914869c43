// Reads SLEAP's analysis export (HDF5) of one video:
//
//   tracks        (tracks, 2, nodes, frames) px, NaN where there is nothing. sleap-io also writes
//                 (frames, tracks, nodes, 2); its attribute "dims" names the dimensions.
//   node_names    (nodes) texts
//   track_names   (tracks) texts; empty without tracks
//   point_scores  (tracks, nodes, frames), or (frames, tracks, nodes); absent in older files
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "loaders/formats/sleap.h"

#include "manifests/json_parse.h"

namespace q3d::loaders::formats {
namespace {

enum Dimension : std::size_t { kTrack, kAxis, kNode, kFrame };

// The strides of the four dimensions in an array that lists them in this order.
struct Layout {
  std::array<std::size_t, 4> stride{};
  std::array<std::size_t, 4> extent{};

  std::size_t at(std::size_t track, std::size_t axis, std::size_t node, std::size_t frame) const {
    return track * stride[kTrack] + axis * stride[kAxis] + node * stride[kNode] + frame * stride[kFrame];
  }
};

Layout layout_of(const std::vector<std::uint64_t>& extents, const std::vector<std::size_t>& order) {
  Layout layout;
  std::size_t stride = 1;
  for (std::size_t i = order.size(); i-- > 0;) {
    layout.stride[order[i]] = stride;
    layout.extent[order[i]] = extents[i];
    stride *= extents[i];
  }
  return layout;
}

// Returns the order of dimensions that the attribute "dims" states, which is a JSON list of names. Empty if
// there is no usable one.
std::vector<std::size_t> stated_order(const ForeignHdf5& file) {
  const auto dims = file.text_attribute("tracks", "dims");
  if (!dims) return {};
  const nlohmann::json list = manifests::parse_json_or_null<nlohmann::json>(*dims);
  std::vector<std::size_t> order;
  for (const nlohmann::json& name : list.is_array() ? list : nlohmann::json::array()) {
    const std::string text = name.is_string() ? name.get<std::string>() : std::string();
    const auto has = [&](const char* part) { return text.find(part) != std::string::npos; };
    order.push_back(has("track") || has("instance") ? kTrack
                    : has("node")                   ? kNode
                    : has("frame")                  ? kFrame
                                                    : kAxis);
  }
  return order.size() == 4 ? order : std::vector<std::size_t>{};
}

std::vector<std::size_t> order_of_tracks(const ForeignHdf5& file, const std::vector<std::uint64_t>& extents,
                                         std::size_t nodes) {
  std::vector<std::size_t> order = stated_order(file);
  const std::vector<std::size_t> usual{kTrack, kAxis, kNode, kFrame};
  const std::vector<std::size_t> transposed{kFrame, kTrack, kNode, kAxis};
  if (order.empty() && extents.size() == 4) {
    order = extents[1] == 2 && extents[2] == nodes ? usual : transposed;
  }
  if (extents.size() == 4 && order.size() == 4) {
    const Layout layout = layout_of(extents, order);
    if (layout.extent[kAxis] == 2 && layout.extent[kNode] == nodes) return order;
  }
  throw std::runtime_error(
      fmt::format("tracks: got extents ({}), expected SLEAP's (tracks, 2, {} nodes, frames) or (frames, "
                  "tracks, {} nodes, 2)",
                  fmt::join(extents, ", "), nodes, nodes));
}

// Returns the scores, in the order of the tracks but without the dimension of x and y. Empty if the file has
// none.
std::vector<double> read_scores(const ForeignHdf5& file, const Layout& tracks,
                                const std::vector<std::size_t>& order, Layout& layout) {
  if (!file.has_dataset("point_scores")) return {};
  std::vector<std::size_t> of_scores;
  for (const std::size_t dimension : order) {
    if (dimension != kAxis) of_scores.push_back(dimension);
  }
  const std::vector<std::uint64_t> extents = file.extents("point_scores");
  bool fits = extents.size() == of_scores.size();
  for (std::size_t i = 0; fits && i < extents.size(); ++i) fits = extents[i] == tracks.extent[of_scores[i]];
  if (!fits) {
    throw std::runtime_error(
        fmt::format("point_scores: got extents ({}), expected those of the tracks without x and y",
                    fmt::join(extents, ", ")));
  }
  layout = layout_of(extents, of_scores);
  return file.numbers("point_scores");
}

}  // namespace

std::optional<LabelTable> read_sleap_analysis(const ForeignHdf5& file) {
  if (!file.has_dataset("tracks") || !file.has_dataset("node_names")) return std::nullopt;
  const std::vector<std::string> nodes = file.texts("node_names");
  const std::vector<std::uint64_t> extents = file.extents("tracks");
  const std::vector<std::size_t> order = order_of_tracks(file, extents, nodes.size());
  const Layout layout = layout_of(extents, order);
  const std::vector<double> positions = file.numbers("tracks");
  Layout score_layout;
  const std::vector<double> scores = read_scores(file, layout, order, score_layout);
  std::vector<std::string> names;
  if (file.has_dataset("track_names")) names = file.texts("track_names");
  if (names.size() > layout.extent[kTrack]) {
    throw std::runtime_error(fmt::format("track_names: got {} names, expected at most the {} tracks",
                                         names.size(), layout.extent[kTrack]));
  }
  SleapTable table(nodes, names);
  for (std::size_t frame = 0; frame < layout.extent[kFrame]; ++frame) {
    table.begin_frame(std::to_string(frame));
    for (std::size_t track = 0; track < layout.extent[kTrack]; ++track) {
      std::vector<SleapTable::Point> points(nodes.size());
      for (std::size_t node = 0; node < nodes.size(); ++node) {
        points[node].x_px = positions[layout.at(track, 0, node, frame)];
        points[node].y_px = positions[layout.at(track, 1, node, frame)];
        // SLEAP gives labels made by hand no score.
        const double score = scores.empty() ? 1.0 : scores[score_layout.at(track, 0, node, frame)];
        if (!std::isnan(score)) points[node].likelihood = score;
      }
      table.add_animal(track < names.size() ? std::optional(track) : std::nullopt, points);
    }
  }
  return table.finish(/*rows_are_numbers=*/true);
}

}  // namespace q3d::loaders::formats
