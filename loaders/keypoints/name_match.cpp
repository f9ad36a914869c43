#include "loaders/keypoints/name_match.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <stdexcept>
#include <string_view>

namespace q3d::loaders::keypoints {
namespace {

std::string folded(std::string_view name) {
  const auto first = name.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  std::string result(name.substr(first, name.find_last_not_of(" \t") - first + 1));
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

void require_enough_in_common(const Topology& topology, std::span<const std::string> names_in_file,
                              const NameMatch& match) {
  const std::size_t known = topology.keypoints.size() - match.missing.size();
  if (known > 0 && 2 * known >= std::min(names_in_file.size(), topology.keypoints.size())) return;
  throw std::invalid_argument(
      fmt::format("got the keypoint names {}; {} in the topology {}, expected most of its names {}. Give the "
                  "topology the file's own names",
                  fmt::join(names_in_file, ", "), known == 0 ? "none is" : fmt::format("only {} are", known),
                  topology.name, fmt::join(topology.keypoints, ", ")));
}

}  // namespace

std::string NameMatch::note(const Topology& topology) const {
  std::string text;
  if (!missing.empty()) {
    text = fmt::format("keypoints of the topology {} that the file lacks, which get weight 0: {} of {} ({})",
                       topology.name, missing.size(), places.size(), fmt::join(missing, ", "));
  }
  if (unknown.empty()) return text;
  return fmt::format(
      "{}{}keypoints of the file that the topology {} lacks, which are left out: {} of {} ({})", text,
      text.empty() ? "" : "; ", topology.name, unknown.size(),
      unknown.size() + places.size() - missing.size(), fmt::join(unknown, ", "));
}

NameMatch match_names(const Topology& topology, std::span<const std::string> names_in_file) {
  NameMatch match;
  match.places.assign(topology.keypoints.size(), -1);
  for (std::size_t k = 0; k < names_in_file.size(); ++k) {
    const std::string name = folded(names_in_file[k]);
    const auto found = std::find_if(topology.keypoints.begin(), topology.keypoints.end(),
                                    [&](const std::string& known) { return folded(known) == name; });
    if (found == topology.keypoints.end()) {
      match.unknown.push_back(names_in_file[k]);
      continue;
    }
    int& place = match.places[static_cast<std::size_t>(found - topology.keypoints.begin())];
    if (place >= 0) {
      throw std::invalid_argument(fmt::format("keypoint {} is named \"{}\", which occurs twice among {}", k,
                                              names_in_file[k], fmt::join(names_in_file, ", ")));
    }
    place = static_cast<int>(k);
  }
  for (std::size_t i = 0; i < match.places.size(); ++i) {
    if (match.places[i] < 0) match.missing.push_back(topology.keypoints[i]);
  }
  require_enough_in_common(topology, names_in_file, match);
  return match;
}

std::vector<manifests::Keypoint> in_topology_order(const NameMatch& match,
                                                   std::span<const manifests::Keypoint> in_file) {
  std::vector<manifests::Keypoint> points(match.places.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (match.places[i] >= 0) points[i] = in_file[static_cast<std::size_t>(match.places[i])];
  }
  return points;
}

}  // namespace q3d::loaders::keypoints
