#include "pipeline/candidates/duplicates.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

namespace q3d::pipeline::candidates {
namespace {

using manifests::Keypoint;

// Copies of a file may round coordinates to whole pixels.
constexpr double kRoundingPx = 0.5;

bool is_same_point(const Keypoint& a, const Keypoint& b) {
  const bool is_visible = a.weight > 0.0F;
  if (is_visible != (b.weight > 0.0F)) return false;
  return !is_visible ||
         (std::abs(a.x_px - b.x_px) <= kRoundingPx && std::abs(a.y_px - b.y_px) <= kRoundingPx);
}

bool is_same_box(const manifests::Box& a, const manifests::Box& b) {
  return std::abs(a.x_px - b.x_px) <= kRoundingPx && std::abs(a.y_px - b.y_px) <= kRoundingPx &&
         std::abs(a.w_px - b.w_px) <= kRoundingPx && std::abs(a.h_px - b.h_px) <= kRoundingPx;
}

// A candidate, reduced to the values that decide whether two candidates of one picture are the same animal.
struct Animal {
  std::size_t index = 0;  // of the candidate
  config::Role role = config::Role::pseudo;
  int orientation = 1;
  manifests::Box box;
  manifests::Keypoints keypoints;
  std::uint32_t visible = 0;  // a bit for each visible keypoint

  Animal(std::size_t place, const Candidate& candidate)
      : index(place),
        role(candidate.role),
        orientation(candidate.record.orientation),
        box(candidate.record.box),
        keypoints(candidate.record.keypoints) {
    static_assert(manifests::kNumKeypoints <= 32);
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      if (keypoints[i].weight > 0.0F) visible |= std::uint32_t{1} << i;
    }
  }
};

// Records without keypoints (photographs) are the same animal if they have the same box.
bool is_same_animal(const Animal& a, const Animal& b) {
  if (a.visible == 0 && !is_same_box(a.box, b.box)) return false;
  return a.visible == b.visible && a.role == b.role && a.orientation == b.orientation &&
         std::equal(a.keypoints.begin(), a.keypoints.end(), b.keypoints.begin(), is_same_point);
}

// Returns whether two samples of one picture look like labels of one animal by two people: for most keypoints
// that both have, the distance is below a twentieth of the box's longer side.
bool is_nearly_same_animal(const Animal& a, const Animal& b) {
  constexpr double kNear = 0.05;
  constexpr int kFewest = 3;
  if (a.role != b.role || a.orientation != b.orientation) return false;
  const std::uint32_t both = a.visible & b.visible;
  const int common = std::popcount(both);
  if (common < kFewest) return false;
  const double reach_px = kNear * std::max(a.box.w_px, a.box.h_px);
  int apart = 0;
  for (std::size_t i = 0; i < a.keypoints.size(); ++i) {
    if ((both >> i & 1U) == 0) continue;
    const double dx = a.keypoints[i].x_px - b.keypoints[i].x_px;
    const double dy = a.keypoints[i].y_px - b.keypoints[i].y_px;
    // Most points lie far apart, which one coordinate already shows.
    const bool is_near =
        std::abs(dx) <= reach_px && std::abs(dy) <= reach_px && std::hypot(dx, dy) <= reach_px;
    apart += is_near ? 0 : 1;
    if (2 * apart >= common) return false;  // most cannot be near any more
  }
  return true;
}

// Candidates of one dataset that repeat another.
struct Repeated {
  std::size_t count = 0;
  std::size_t first = 0;  // the first of them
  std::size_t of = 0;     // the candidate that it repeats

  void add(std::size_t index, std::size_t repeats) {
    if (count++ > 0 && index > first) return;
    first = index;
    of = repeats;
  }
};

using RepeatedByDataset = std::map<std::string, Repeated>;

// Compares the candidates of one picture with each other.
class PictureGroups {
 public:
  explicit PictureGroups(CandidateList& candidates) : candidates_(candidates) {}

  // `group` holds the positions of candidates whose pictures' digests have the same first digits.
  void add(const std::vector<std::size_t>& group) {
    std::map<std::string, std::vector<Animal>> kept;  // by the whole digest
    for (const std::size_t index : group) {
      const Candidate candidate = candidates_.at(index);
      compare(candidate, Animal(index, candidate), kept[candidate.image_sha256]);
    }
  }
  const RepeatedByDataset& repeated() const { return repeated_; }
  const RepeatedByDataset& nearly_repeated() const { return nearly_repeated_; }

 private:
  void compare(const Candidate& candidate, const Animal& animal, std::vector<Animal>& earlier) {
    const auto same = std::find_if(earlier.begin(), earlier.end(),
                                   [&](const Animal& each) { return is_same_animal(each, animal); });
    const std::string dataset = dataset_key(candidate.record);
    if (same != earlier.end()) {
      candidates_.fail(animal.index, manifests::Reason::duplicate,
                       "it is that of " + candidates_.at(same->index).record.id);
      repeated_[dataset].add(animal.index, same->index);
      return;
    }
    const auto near = std::find_if(earlier.begin(), earlier.end(),
                                   [&](const Animal& each) { return is_nearly_same_animal(each, animal); });
    if (near != earlier.end()) nearly_repeated_[dataset].add(animal.index, near->index);
    earlier.push_back(animal);
  }

  CandidateList& candidates_;
  RepeatedByDataset repeated_;
  RepeatedByDataset nearly_repeated_;
};

}  // namespace

void Duplicates::add(std::size_t index, const Candidate& candidate) {
  constexpr std::size_t kDigits = 16;
  if (candidate.record.failure != manifests::Reason::none || candidate.image_sha256.empty()) return;
  const std::string_view digits = std::string_view(candidate.image_sha256).substr(0, kDigits);
  std::uint64_t picture = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), picture, 16);
  if (error != std::errc() || end != digits.data() + digits.size()) {
    throw std::invalid_argument("got the digest " + candidate.image_sha256 + ", expected hexadecimal digits");
  }
  pictured_.push_back({picture, index});
}

void Duplicates::fail(CandidateList& candidates, std::vector<IngestNote>& notes) {
  std::sort(pictured_.begin(), pictured_.end());
  PictureGroups groups(candidates);
  std::vector<std::size_t> group;
  for (std::size_t i = 0; i < pictured_.size(); ++i) {
    group.push_back(pictured_[i].index);
    if (i + 1 < pictured_.size() && pictured_[i + 1].picture == pictured_[i].picture) continue;
    if (group.size() > 1) groups.add(group);
    group.clear();
  }
  const auto id = [&](std::size_t index) { return candidates.at(index).record.id; };
  for (const auto& [dataset, each] : groups.repeated()) {
    notes.push_back({loaders::formats::NoteKind::caution, dataset,
                     fmt::format("duplicates: samples with the picture and the keypoints of an earlier one, "
                                 "which is counted once: {}, first {}",
                                 each.count, id(each.first))});
  }
  for (const auto& [dataset, each] : groups.nearly_repeated()) {
    notes.push_back(
        {loaders::formats::NoteKind::caution, dataset,
         fmt::format("samples that look like the same animal in the same picture as an earlier one, as "
                     "if two people had labelled it; all are kept, so it counts twice: {}, first {} after {}",
                     each.count, id(each.first), id(each.of))});
  }
}

}  // namespace q3d::pipeline::candidates
