#include "loaders/keypoints/topology_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "loaders/keypoints/builtin_topologies.h"
#include "manifests/json_file.h"

namespace q3d::loaders::keypoints {
namespace {

using nlohmann::json;

constexpr std::array<std::string_view, 6> kKeys{"name",       "about",      "keypoints",
                                                "flip_pairs", "animal3d26", "weights"};
constexpr std::size_t kMaxKeypoints = 1000;  // a longer list is no list of an animal's keypoints

class Reader {
 public:
  Reader(const std::filesystem::path& file, json document) : file_(file), document_(std::move(document)) {}

  Topology read() {
    check_keys();
    topology_.name = text(member("name"), "name");
    read_keypoints();
    read_flip_pairs();
    read_map();
    read_weights();
    check_mirrored_map();
    return std::move(topology_);
  }

 private:
  [[noreturn]] void fail(const std::string& key, const std::string& got, const std::string& expected) const {
    throw std::runtime_error(fmt::format("{}: {}: got {}, expected {}", file_.string(), key, got, expected));
  }

  void check_keys() const {
    if (!document_.is_object()) fail("top level", manifests::describe(document_), "an object");
    for (const auto& [key, value] : document_.items()) {
      if (std::find(kKeys.begin(), kKeys.end(), key) != kKeys.end()) continue;
      const bool is_coco = document_.contains("images") && document_.contains("annotations");
      fail("top level", fmt::format("the key \"{}\"", key),
           fmt::format("one of {}{}", fmt::join(kKeys, ", "),
                       is_coco ? ". This is a COCO file of labels, no topology; `quadruped3d topology --from "
                                 "FILE` makes one from it"
                               : ""));
    }
  }

  const json& member(const char* key) const {
    const auto found = document_.find(key);
    if (found == document_.end()) fail(key, "nothing", "this key; docs/own-labels.md shows a whole file");
    return *found;
  }

  std::string text(const json& value, const std::string& key) const {
    if (!value.is_string() || value.get_ref<const std::string&>().empty()) {
      fail(key, manifests::describe(value), "a text");
    }
    return value.get<std::string>();
  }

  // Returns the index of a keypoint of this topology.
  int place(const json& value, const std::string& key) const {
    const std::string name = text(value, key);
    const auto& names = topology_.keypoints;
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) fail(key, fmt::format("\"{}\"", name), "a name of \"keypoints\"");
    return static_cast<int>(found - names.begin());
  }

  void read_keypoints() {
    const json& names = member("keypoints");
    if (!names.is_array() || names.empty() || names.size() > kMaxKeypoints) {
      fail("keypoints", manifests::describe(names), fmt::format("1 to {} names", kMaxKeypoints));
    }
    std::set<std::string> seen;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string key = fmt::format("keypoints[{}]", i);
      std::string name = text(names[i], key);
      if (!seen.insert(name).second) fail(key, fmt::format("\"{}\" again", name), "each name once");
      topology_.keypoints.push_back(std::move(name));
    }
    topology_.flip.resize(names.size());
    std::iota(topology_.flip.begin(), topology_.flip.end(), 0);
    topology_.weights.assign(names.size(), 1.0F);
  }

  void read_flip_pairs() {
    const json& pairs = member("flip_pairs");
    if (!pairs.is_array()) fail("flip_pairs", manifests::describe(pairs), "a list of pairs of names");
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const std::string key = fmt::format("flip_pairs[{}]", i);
      if (!pairs[i].is_array() || pairs[i].size() != 2) fail(key, manifests::describe(pairs[i]), "two names");
      const int left = place(pairs[i][0], key);
      const int right = place(pairs[i][1], key);
      int& of_left = topology_.flip[static_cast<std::size_t>(left)];
      int& of_right = topology_.flip[static_cast<std::size_t>(right)];
      if (left == right || of_left != left || of_right != right) {
        fail(key, pairs[i].dump(), "two names that are in no other pair");
      }
      std::swap(of_left, of_right);
    }
  }

  void read_map() {
    const json& map = member("animal3d26");
    if (!map.is_object() || map.empty()) fail("animal3d26", manifests::describe(map), "an object of names");
    const std::vector<std::string>& names = topology("animal3d26").keypoints;
    topology_.source.fill(-1);
    for (const auto& [name, source] : map.items()) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end()) {
        fail("animal3d26", fmt::format("\"{}\"", name), fmt::format("one of {}", fmt::join(names, ", ")));
      }
      topology_.source[static_cast<std::size_t>(found - names.begin())] =
          place(source, fmt::format("animal3d26.{}", name));
    }
  }

  void read_weights() {
    const auto weights = document_.find("weights");
    if (weights == document_.end()) return;
    if (!weights->is_object()) fail("weights", manifests::describe(*weights), "an object of numbers");
    for (const auto& [name, weight] : weights->items()) {
      const std::string key = fmt::format("weights.{}", name);
      const int at = place(name, key);
      const double value = weight.is_number() ? weight.get<double>() : -1.0;
      if (!(value >= 0.0 && value <= 1.0)) fail(key, manifests::describe(weight), "a number from 0 to 1");
      topology_.weights[static_cast<std::size_t>(at)] = static_cast<float>(value);
    }
  }

  // Mirroring a picture before the map or after it must give the same 26. Where only one side of the animal
  // is labelled, one of two mirror images has no source, and nothing can differ.
  void check_mirrored_map() const {
    const Topology& animal3d = topology("animal3d26");
    for (std::size_t i = 0; i < topology_.source.size(); ++i) {
      const auto mirror = static_cast<std::size_t>(animal3d.flip[i]);
      const int here = topology_.source[i];
      const int there = topology_.source[mirror];
      if (here < 0) continue;
      const int partner = topology_.flip[static_cast<std::size_t>(here)];
      if (there >= 0 ? partner == there : !is_mapped_to_another(here, partner)) continue;
      const auto name = [&](int at) {
        return at < 0 ? std::string("nothing")
                      : fmt::format("\"{}\"", topology_.keypoints[static_cast<std::size_t>(at)]);
      };
      fail("animal3d26",
           fmt::format("{} from {} and {} from {}", animal3d.keypoints[i], name(here),
                       animal3d.keypoints[mirror], name(there)),
           "two keypoints that form a pair of \"flip_pairs\", one keypoint that is its own mirror image, or, "
           "if only one side is labelled, nothing for the other side");
    }
  }

  // Returns whether the mirror image of a keypoint is mapped although it is another keypoint.
  bool is_mapped_to_another(int keypoint, int partner) const {
    const auto& source = topology_.source;
    return partner != keypoint && std::find(source.begin(), source.end(), partner) != source.end();
  }

  const std::filesystem::path& file_;
  json document_;
  Topology topology_;
};

}  // namespace

bool is_builtin_topology(const std::filesystem::path& name_or_file) {
  const auto all = builtin_topologies();
  return std::any_of(all.begin(), all.end(),
                     [&](const BuiltinTopology& each) { return each.name == name_or_file.native(); });
}

Topology read_topology_file(const std::filesystem::path& name_or_file) {
  std::vector<std::string_view> names;
  for (const BuiltinTopology& each : builtin_topologies()) {
    if (each.name == name_or_file.native()) return Reader(name_or_file, json::parse(each.text)).read();
    names.push_back(each.name);
  }
  if (!std::filesystem::exists(name_or_file)) {
    throw std::runtime_error(fmt::format(
        "{}: there is no such file, and no built-in topology of this name; the built-in ones are {}. "
        "`quadruped3d topology --from FILE` makes one for a label file",
        name_or_file.string(), fmt::join(names, ", ")));
  }
  return Reader(name_or_file, manifests::read_json_file(name_or_file)).read();
}

}  // namespace q3d::loaders::keypoints
