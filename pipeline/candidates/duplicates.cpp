#include "pipeline/candidates/duplicates.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>

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

// Records without keypoints (photographs) are the same animal if they have the same box.
bool is_same_animal(const Candidate& a, const Candidate& b) {
  const bool has_keypoints = std::any_of(a.record.keypoints.begin(), a.record.keypoints.end(),
                                         [](const Keypoint& point) { return point.weight > 0.0F; });
  if (!has_keypoints && !is_same_box(a.record.box, b.record.box)) return false;
  return a.role == b.role && a.record.orientation == b.record.orientation &&
         std::equal(a.record.keypoints.begin(), a.record.keypoints.end(), b.record.keypoints.begin(),
                    is_same_point);
}

// Whether two samples of one picture look like labels of one animal by two people: most of the keypoints that
// both have lie within a twentieth of the box's longer side.
bool is_nearly_same_animal(const Candidate& a, const Candidate& b) {
  constexpr double kNear = 0.05;
  constexpr int kFewest = 3;
  if (a.role != b.role || a.record.orientation != b.record.orientation) return false;
  const double reach_px = kNear * std::max(a.record.box.w_px, a.record.box.h_px);
  int common = 0;
  int near = 0;
  for (std::size_t i = 0; i < a.record.keypoints.size(); ++i) {
    const Keypoint& p = a.record.keypoints[i];
    const Keypoint& q = b.record.keypoints[i];
    if (!(p.weight > 0.0F && q.weight > 0.0F)) continue;
    ++common;
    near += std::hypot(p.x_px - q.x_px, p.y_px - q.y_px) <= reach_px ? 1 : 0;
  }
  return common >= kFewest && 2 * near > common;
}

struct Repeated {
  std::size_t count = 0;
  std::string first;
};

}  // namespace

void fail_duplicates(std::vector<Candidate>& candidates, std::vector<IngestNote>& notes) {
  std::unordered_map<std::string, std::vector<const Candidate*>> of_picture;  // by SHA-256
  std::map<std::string, Repeated> repeated;                                   // by dataset
  std::map<std::string, Repeated> nearly_repeated;
  for (Candidate& candidate : candidates) {
    if (candidate.record.failure != manifests::Reason::none || candidate.image_sha256.empty()) continue;
    std::vector<const Candidate*>& earlier = of_picture[candidate.image_sha256];
    const auto found = std::find_if(earlier.begin(), earlier.end(),
                                    [&](const Candidate* each) { return is_same_animal(*each, candidate); });
    if (found == earlier.end()) {
      const auto near = std::find_if(earlier.begin(), earlier.end(), [&](const Candidate* each) {
        return is_nearly_same_animal(*each, candidate);
      });
      if (near != earlier.end()) {
        Repeated& here = nearly_repeated[candidate.record.dataset + "/" + candidate.record.split];
        if (here.count++ == 0)
          here.first = fmt::format("{} after {}", candidate.record.id, (*near)->record.id);
      }
      earlier.push_back(&candidate);
      continue;
    }
    candidate.record.failure = manifests::Reason::duplicate;
    candidate.record.failure_detail = "it is that of " + (*found)->record.id;
    Repeated& here = repeated[candidate.record.dataset + "/" + candidate.record.split];
    if (here.count++ == 0) here.first = candidate.record.id;
  }
  for (const auto& [dataset, each] : repeated) {
    notes.push_back(
        {loaders::formats::NoteKind::caution, dataset,
         fmt::format("duplicates: samples with the picture and the keypoints of an earlier one, which "
                     "is counted once: {}, first {}",
                     each.count, each.first)});
  }
  for (const auto& [dataset, each] : nearly_repeated) {
    notes.push_back(
        {loaders::formats::NoteKind::caution, dataset,
         fmt::format("samples that look like the same animal in the same picture as an earlier one, as "
                     "if two people had labelled it; all are kept, so it counts twice: {}, first {}",
                     each.count, each.first)});
  }
}

}  // namespace q3d::pipeline::candidates
