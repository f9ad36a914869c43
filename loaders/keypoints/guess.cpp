#include "loaders/keypoints/guess.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <stdexcept>

#include "loaders/keypoints/keypoint_words.h"

namespace q3d::loaders::keypoints {
namespace {

std::string sided(Side side, const std::string& rest) {
  return (side == Side::left ? "left_" : "right_") + rest;
}

class Guesser {
 public:
  Guesser(const std::string& name, std::span<const std::string> names) {
    topology_.name = name;
    topology_.keypoints.assign(names.begin(), names.end());
    topology_.weights.assign(names.size(), 1.0F);
    topology_.source.fill(-1);
    topology_.flip.resize(names.size());
    std::iota(topology_.flip.begin(), topology_.flip.end(), 0);
    for (const std::string& each : names) words_.push_back(words_of(each));
  }

  TopologyGuess guess() {
    pair_up();
    for (std::size_t i = 0; i < words_.size(); ++i) map_keypoint(i);
    drop_lone_sides();
    list_unmapped();
    return {std::move(topology_), std::move(doubts_)};
  }

 private:
  const std::string& name(std::size_t i) const { return topology_.keypoints[i]; }

  void pair_up() {
    for (std::size_t i = 0; i < words_.size(); ++i) {
      if (words_[i].side != Side::left) continue;
      for (std::size_t k = 0; k < words_.size(); ++k) {
        if (words_[k].side != Side::right || words_[k].without_side != words_[i].without_side) continue;
        topology_.flip[i] = static_cast<int>(k);
        topology_.flip[k] = static_cast<int>(i);
      }
    }
    for (std::size_t i = 0; i < words_.size(); ++i) {
      if (words_[i].side != Side::none && topology_.flip[i] == static_cast<int>(i)) {
        doubts_.push_back(
            fmt::format("\"{}\" is on one side, but no name looks like its mirror image", name(i)));
      }
    }
  }

  bool has(Part part, End end) const {
    return std::any_of(words_.begin(), words_.end(), [&](const KeypointWords& each) {
      return each.part == part && (end == End::none || each.end == end);
    });
  }

  // Returns the name among the 26, without its side, for parts of legs; empty if there is none.
  std::string leg_target(const KeypointWords& words) {
    const bool is_front = words.end == End::front;
    switch (words.part) {
      case Part::paw:
        return is_front ? "front_paw" : "back_paw";
      case Part::carpus:
        return is_front ? "front_knee" : "";
      case Part::elbow:
        return is_front ? "front_thigh" : "";
      case Part::tarsus:
        return is_front ? "" : "back_knee";
      case Part::stifle:
        return is_front ? "" : "back_thigh";
      case Part::thigh:
        return is_front ? "front_thigh" : "back_thigh";
      case Part::knee:
        if (is_front) return "front_knee";
        // The true knee is the stifle. Many sets call the hock "knee", because it looks like one.
        return has(Part::tarsus, End::none) ? "back_thigh" : "back_knee";
      default:
        return {};
    }
  }

  // Returns the end of the body (front or back). If the name does not say it, it follows from the part.
  static End end_of(const KeypointWords& words) {
    if (words.end != End::none) return words.end;
    switch (words.part) {
      case Part::elbow:
      case Part::carpus:
        return End::front;
      case Part::stifle:
      case Part::tarsus:
        return End::back;
      default:
        return End::none;
    }
  }

  static std::string middle_target(Part part) {
    switch (part) {
      case Part::nose:
        return "nose";
      case Part::chin:
        return "chin";
      case Part::neck:
        return "neck";
      case Part::tail_base:
        return "tail_base";
      case Part::tail_mid:
        return "tail_mid";
      case Part::tail_tip:
        return "tail_tip";
      default:
        return {};
    }
  }

  static std::string side_target(Part part) {
    switch (part) {
      case Part::eye:
        return "eye";
      case Part::ear:
        return "ear";
      case Part::mouth_corner:
        return "mouth_corner";
      case Part::shoulder:
        return "shoulder";
      default:
        return {};
    }
  }

  void map_keypoint(std::size_t i) {
    KeypointWords words = words_[i];
    words.end = end_of(words);
    std::string target = words.side == Side::none ? middle_target(words.part) : std::string();
    if (words.side != Side::none) {
      target = side_target(words.part);
      if (target.empty() && words.end != End::none) target = leg_target(words);
      if (!target.empty()) target = sided(words.side, target);
    }
    if (target.empty()) return;
    take(i, target);
    remark(i, words, target);
  }

  void take(std::size_t i, const std::string& target) {
    const std::vector<std::string>& known = topology("animal3d26").keypoints;
    const auto place =
        static_cast<std::size_t>(std::find(known.begin(), known.end(), target) - known.begin());
    int& source = topology_.source.at(place);
    if (source >= 0) {
      doubts_.push_back(fmt::format("\"{}\" and \"{}\" both look like {}; the first is taken",
                                    name(static_cast<std::size_t>(source)), name(i), target));
      return;
    }
    source = static_cast<int>(i);
  }

  // Adds a doubt about a part that different datasets place differently.
  void remark(std::size_t i, const KeypointWords& words, const std::string& target) {
    const auto doubt = [&](const std::string& text) {
      doubts_.push_back(fmt::format("\"{}\" -> {}: {}", name(i), target, text));
    };
    switch (words.part) {
      case Part::neck:
        doubt("the neck of the 26 is its end at the head; give yours the weight 0 if it is at the shoulders");
        break;
      case Part::shoulder:
        doubt(
            "the shoulder of the 26 is at the height of the withers; map yours to the front thigh if it is "
            "at the elbow");
        break;
      case Part::knee:
        if (words.end == End::back) {
          doubt(
              "is this the true knee (stifle, the back thigh of the 26) or the hock (the back knee of the "
              "26)?");
        }
        break;
      case Part::chin:
        doubt("is it the chin, and not the angle of the jaw?");
        break;
      default:
        break;
    }
  }

  // Drops a mapped keypoint of the 26 whose mirror image is labelled but not mapped. If only one side is
  // labelled, it may map alone.
  void drop_lone_sides() {
    const Topology& animal3d = topology("animal3d26");
    for (std::size_t i = 0; i < topology_.source.size(); ++i) {
      const auto mirror = static_cast<std::size_t>(animal3d.flip[i]);
      const int here = topology_.source[i];
      const int there = topology_.source[mirror];
      const int partner = here < 0 ? -1 : topology_.flip[static_cast<std::size_t>(here)];
      if (here < 0 || (there >= 0 ? partner == there : partner == here)) continue;
      doubts_.push_back(fmt::format(
          "\"{}\" looks like {}, but nothing that is its mirror image looks like {}; it is left out",
          name(static_cast<std::size_t>(here)), animal3d.keypoints[i], animal3d.keypoints[mirror]));
      dropped_.insert(here);
    }
    for (int& source : topology_.source) {
      if (dropped_.contains(source)) source = -1;
    }
  }

  void list_unmapped() {
    std::vector<std::string> unmapped;
    for (std::size_t i = 0; i < words_.size(); ++i) {
      const auto& sources = topology_.source;
      const bool is_mapped = std::find(sources.begin(), sources.end(), static_cast<int>(i)) != sources.end();
      if (!is_mapped && !dropped_.contains(static_cast<int>(i))) unmapped.push_back(name(i));
    }
    if (unmapped.empty()) return;
    doubts_.push_back(fmt::format("no counterpart among the 26 was found for {}; they count for boxes only",
                                  fmt::join(unmapped, ", ")));
  }

  Topology topology_;
  std::vector<KeypointWords> words_;
  std::vector<std::string> doubts_;
  std::set<int> dropped_;
};

}  // namespace

TopologyGuess guess_topology(const std::string& name, std::span<const std::string> names) {
  const std::set<std::string> distinct(names.begin(), names.end());
  if (names.empty() || distinct.size() != names.size()) {
    throw std::invalid_argument(
        fmt::format("keypoint names: got {} names, {} of them different, expected at least one, each once",
                    names.size(), distinct.size()));
  }
  return Guesser(name, names).guess();
}

nlohmann::ordered_json topology_json(const Topology& topology_given, const std::string& about) {
  const Topology& given = topology_given;
  const auto name = [&](int i) { return given.keypoints[static_cast<std::size_t>(i)]; };
  nlohmann::ordered_json file = {{"name", given.name}, {"about", about}, {"keypoints", given.keypoints}};
  file["flip_pairs"] = nlohmann::ordered_json::array();
  for (int i = 0; i < static_cast<int>(given.flip.size()); ++i) {
    const int other = given.flip[static_cast<std::size_t>(i)];
    if (other == i) continue;
    const bool is_left = words_of(name(i)).side != Side::right;
    // Write each pair once, left first if the names say which one is left.
    const bool is_first = words_of(name(i)).side == words_of(name(other)).side ? i < other : is_left;
    if (is_first) file["flip_pairs"].push_back({name(i), name(other)});
  }
  file["animal3d26"] = nlohmann::ordered_json::object();
  const std::vector<std::string>& targets = topology("animal3d26").keypoints;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (given.source[i] >= 0) file["animal3d26"][targets[i]] = name(given.source[i]);
  }
  for (std::size_t i = 0; i < given.weights.size(); ++i) {
    if (given.weights[i] != 1.0F) file["weights"][given.keypoints[i]] = given.weights[i];
  }
  return file;
}

}  // namespace q3d::loaders::keypoints
