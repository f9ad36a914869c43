// Reads SLEAP's .slp (HDF5):
//
//   metadata.attrs["json"]       skeletons, and the nodes that they point into
//   metadata.attrs["format_id"]  below 1.1, the corner of a picture is (0, 0), later the centre of its first
//                                pixel is
//   videos_json, tracks_json     a JSON text for each video and track
//   frames       {frame_id, video, frame_idx, instance_id_start, instance_id_end}
//   instances    {instance_type (0 made by hand, 1 predicted), skeleton, track, from_predicted,
//   point_id_start,
//                point_id_end, ...}
//   points, pred_points          {x, y, visible, complete[, score]} px
//
// Source: sleap-io's dev/formats/slp.md.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "loaders/formats/hdf5_claims.h"
#include "loaders/formats/sleap.h"
#include "manifests/json_parse.h"

namespace q3d::loaders::formats {
namespace {

using nlohmann::json;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kCentredFormat = 1.1;
constexpr std::uint64_t kLargestSidePx = 1'000'000;

json parsed(const std::string& text, const std::string& where) {
  json value = manifests::parse_json_or_null<json>(text);
  if (value.is_null()) refuse(where, "text that is not JSON", "JSON");
  return value;
}

// Returns the names of a skeleton's nodes, in the order of its points.
std::vector<std::string> node_names(const json& metadata, std::size_t skeleton) {
  const std::string where = fmt::format("metadata: skeletons[{}]", skeleton);
  const auto list = [&](const json& object, const char* key) -> const json& {
    if (!object.is_object() || !object.contains(key) || !object[key].is_array())
      refuse(where, "nothing", fmt::format("a list \"{}\"", key));
    return object[key];
  };
  const json& skeletons = list(metadata, "skeletons");
  const json& nodes = list(metadata, "nodes");
  if (skeleton >= skeletons.size()) refuse(where, "nothing", "a skeleton");
  std::vector<std::string> names;
  for (const json& entry : list(skeletons[skeleton], "nodes")) {
    const json& place = entry.is_object() && entry.contains("id") ? entry["id"] : entry;
    const bool is_place = place.is_number_unsigned() && place.get<std::size_t>() < nodes.size();
    const json& node = is_place ? nodes[place.get<std::size_t>()] : place;
    if (!node.is_object() || !node.contains("name") || !node["name"].is_string())
      refuse(where, entry.dump(), "the place of a node with a name");
    names.push_back(node["name"].get<std::string>());
  }
  return names;
}

// A track is [0, "name"], or an object with a name.
std::vector<std::string> track_names(const ForeignHdf5& file) {
  std::vector<std::string> names;
  if (!file.has_dataset("tracks_json")) return names;
  for (const std::string& text : file.texts("tracks_json")) {
    const json track = parsed(text, "tracks_json");
    const json name = track.is_array() && track.size() > 1 ? track[1]
                      : track.is_object()                  ? track.value("name", json())
                                                           : json();
    names.push_back(name.is_string() ? name.get<std::string>() : std::string());
  }
  return names;
}

struct Video {
  LabelVideo facts;
  std::vector<std::string> pictures{};  // names, if the video is a list of pictures
};

// Returns the pictures' names of a video that is a list of pictures; empty for any other video.
std::vector<std::string> pictures_of(const json& document, const json& backend) {
  for (const json* holder : {&backend, &document}) {
    for (const char* key : {"filename", "image_filenames", "filenames"}) {
      if (!holder->is_object() || !holder->contains(key) || !(*holder)[key].is_array()) continue;
      std::vector<std::string> names;
      for (const json& name : (*holder)[key]) {
        names.push_back(name.is_string() ? name.get<std::string>() : std::string());
      }
      return names;
    }
  }
  return {};
}

// A file states the size of a video as (frames, height, width, channels), or not at all.
Video video_of(const std::string& text) {
  const json document = parsed(text, "videos_json");
  const json backend = document.is_object() ? document.value("backend", json::object()) : json::object();
  Video video{{}, pictures_of(document, backend)};
  const auto member = [&](const char* key) {
    const json in_document = document.is_object() ? document.value(key, json()) : json();
    return backend.is_object() ? backend.value(key, in_document) : in_document;
  };
  if (const json name = member("filename"); name.is_string()) {
    video.facts.name = std::filesystem::path(row_name({name.get<std::string>()})).stem().string();
  }
  const json shape = member("shape");
  if (!video.pictures.empty() || !shape.is_array() || shape.size() != 4) return video;
  const auto side = [&](std::size_t i) {
    const bool is_side = shape[i].is_number_unsigned() && shape[i].get<std::uint64_t>() <= kLargestSidePx;
    return is_side ? shape[i].get<int>() : 0;
  };
  video.facts.height_px = side(1);
  video.facts.width_px = side(2);
  return video;
}

// The columns of the tables that are read.
struct Columns {
  std::vector<double> video, frame, first_instance, end_instance;
  std::vector<double> type, skeleton, track, from_predicted, first_point, end_point;

  explicit Columns(const ForeignHdf5& file)
      : video(file.field("frames", "video")),
        frame(file.field("frames", "frame_idx")),
        first_instance(file.field("frames", "instance_id_start")),
        end_instance(file.field("frames", "instance_id_end")),
        first_point(file.field("instances", "point_id_start")),
        end_point(file.field("instances", "point_id_end")) {
    const std::vector<std::string> known = file.fields("instances");
    const auto column = [&](const char* name, double absent) {
      const bool is_there = std::find(known.begin(), known.end(), name) != known.end();
      return is_there ? file.field("instances", name) : std::vector<double>(first_point.size(), absent);
    };
    type = column("instance_type", 0.0);
    skeleton = column("skeleton", 0.0);
    track = column("track", -1.0);
    from_predicted = column("from_predicted", -1.0);
  }
};

struct Points {
  std::vector<double> x, y, visible, score;
};

Points read_points(const ForeignHdf5& file, const std::string& name, double shift) {
  Points points;
  if (!file.has_dataset(name)) return points;
  points.x = file.field(name, "x");
  points.y = file.field(name, "y");
  points.visible = file.field(name, "visible");
  const std::vector<std::string> known = file.fields(name);
  const bool has_score = std::find(known.begin(), known.end(), "score") != known.end();
  points.score = has_score ? file.field(name, "score") : std::vector<double>(points.x.size(), 1.0);
  for (std::vector<double>* axis : {&points.x, &points.y}) {
    for (double& value : *axis) value -= shift;
  }
  return points;
}

class LabelsReader {
 public:
  explicit LabelsReader(const ForeignHdf5& file) : file_(file), columns_(file) {
    const double format = file.number_attribute("metadata", "format_id").value_or(kCentredFormat);
    const double shift = format < kCentredFormat ? 0.5 : 0.0;
    by_hand_ = read_points(file, "points", shift);
    predicted_ = read_points(file, "pred_points", shift);
  }

  LabelTable read() {
    const json metadata = parsed(*file_.text_attribute("metadata", "json"), "metadata.json");
    const std::vector<Video> videos = used_videos();
    nodes_ = node_names(metadata, only_skeleton());
    SleapTable table(nodes_, track_names(file_));
    for (std::size_t i = 0; i < columns_.frame.size(); ++i) {
      const auto number = static_cast<std::int64_t>(columns_.frame[i]);
      const std::size_t video = place_of_video(columns_.video[i]);
      const std::vector<std::string>& pictures = videos[video].pictures;
      table.begin_frame(pictures.empty() ? std::to_string(number) : picture(pictures, number), video);
      add_frame(i, table);
    }
    std::vector<LabelVideo> facts;
    for (const Video& video : videos) facts.push_back(video.facts);
    return table.finish(/*rows_are_numbers=*/videos.empty() || videos.front().pictures.empty(),
                        std::move(facts));
  }

 private:
  static std::string picture(const std::vector<std::string>& pictures, std::int64_t number) {
    if (number < 0 || static_cast<std::size_t>(number) >= pictures.size()) {
      refuse("frames.frame_idx", std::to_string(number), fmt::format("0 to {}", pictures.size() - 1));
    }
    return row_name({pictures[static_cast<std::size_t>(number)]});
  }

  // Returns the half-open range of rows that a frame or instance points to.
  static std::pair<std::size_t, std::size_t> range(double first, double end, std::size_t rows,
                                                   const std::string& where) {
    if (!(first >= 0.0 && first <= end && end <= static_cast<double>(rows))) {
      refuse(where, fmt::format("rows {} to {}", first, end), fmt::format("rows within the {}", rows));
    }
    return {static_cast<std::size_t>(first), static_cast<std::size_t>(end)};
  }

  // Returns the videos that have frames, in the order of their numbers. Frames of different videos share
  // numbers, so the videos must have different names.
  std::vector<Video> used_videos() {
    const std::vector<std::string> texts = file_.texts("videos_json");
    used_ = {columns_.video.begin(), columns_.video.end()};
    std::vector<Video> videos;
    std::set<std::string> names;
    for (const double number : used_) {
      videos.push_back(video_of(texts.at(range(number, number + 1.0, texts.size(), "frames.video").first)));
      names.insert(videos.back().facts.name);
    }
    const auto lists = static_cast<std::size_t>(std::count_if(
        videos.begin(), videos.end(), [](const Video& video) { return !video.pictures.empty(); }));
    const bool are_told_apart = lists == 0 && names.size() == videos.size() && !names.contains("");
    if (videos.size() < 2 || lists == videos.size() || are_told_apart) return videos;
    refuse("frames.video", fmt::format("labels of the {} videos {}", videos.size(), fmt::join(names, ", ")),
           "videos of different names, or lists of pictures alone, because the frames of several videos have "
           "the same numbers; export each video's analysis as a file of its own");
  }

  // Returns the position of a video among the used ones.
  std::size_t place_of_video(double number) const {
    return static_cast<std::size_t>(std::distance(used_.begin(), used_.find(number)));
  }

  std::size_t only_skeleton() const {
    const std::set<double> used(columns_.skeleton.begin(), columns_.skeleton.end());
    if (used.size() > 1 || (!used.empty() && !(*used.begin() >= 0.0))) {
      refuse("instances.skeleton", fmt::format("the skeletons {}", fmt::join(used, ", ")), "one skeleton");
    }
    return used.empty() ? 0 : static_cast<std::size_t>(*used.begin());
  }

  bool is_predicted(std::size_t instance) const { return columns_.type[instance] == 1.0; }

  // Returns whether somebody has corrected this prediction: a label made by hand in the same frame was made
  // from it, or has its track.
  bool is_replaced(std::size_t instance, std::size_t first, std::size_t end) const {
    if (!is_predicted(instance)) return false;
    for (std::size_t other = first; other < end; ++other) {
      const bool has_same_track =
          columns_.track[other] >= 0.0 && columns_.track[other] == columns_.track[instance];
      const bool is_made_from_it = columns_.from_predicted[other] == static_cast<double>(instance);
      if (!is_predicted(other) && (has_same_track || is_made_from_it)) return true;
    }
    return false;
  }

  void add_frame(std::size_t row, SleapTable& table) const {
    const auto [first, end] = range(columns_.first_instance[row], columns_.end_instance[row],
                                    columns_.first_point.size(), fmt::format("frames[{}]", row));
    for (std::size_t instance = first; instance < end; ++instance) {
      if (is_replaced(instance, first, end)) continue;
      const double track = columns_.track[instance];
      table.add_animal(track >= 0.0 ? std::optional(static_cast<std::size_t>(track)) : std::nullopt,
                       points_of(instance));
    }
  }

  std::vector<SleapTable::Point> points_of(std::size_t instance) const {
    const Points& from = is_predicted(instance) ? predicted_ : by_hand_;
    const std::string where = fmt::format("instances[{}]", instance);
    const auto [first, end] =
        range(columns_.first_point[instance], columns_.end_point[instance], from.x.size(), where);
    if (end - first != nodes_.size()) {
      refuse(where, fmt::format("{} points", end - first), fmt::format("the skeleton's {}", nodes_.size()));
    }
    std::vector<SleapTable::Point> points(nodes_.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const bool is_labelled = from.visible[first + i] != 0.0 && !std::isnan(from.y[first + i]);
      points[i].x_px = is_labelled ? from.x[first + i] : kNaN;
      points[i].y_px = is_labelled ? from.y[first + i] : kNaN;
      points[i].likelihood = is_predicted(instance) ? from.score[first + i] : 1.0;
    }
    return points;
  }

  const ForeignHdf5& file_;
  Columns columns_;
  Points by_hand_;
  Points predicted_;
  std::vector<std::string> nodes_;
  std::set<double> used_;  // numbers of the videos that have frames
};

}  // namespace

std::optional<LabelTable> read_sleap_labels(const ForeignHdf5& file) {
  const bool is_sleap = file.has_group("metadata") && file.has_dataset("frames") &&
                        file.has_dataset("instances") && file.has_dataset("videos_json") &&
                        file.text_attribute("metadata", "json");
  if (!is_sleap) return std::nullopt;
  return LabelsReader(file).read();
}

}  // namespace q3d::loaders::formats
