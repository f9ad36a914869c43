#include "pipeline/candidates/candidate_bytes.h"

#include "manifests/spill_bytes.h"

namespace q3d::pipeline::candidates {
namespace {

// Visits every member except truth and exclusion, so that writing and reading share one list.
template <typename SomeCandidate, typename Visitor>
void visit(SomeCandidate& candidate, Visitor& visitor) {
  auto& record = candidate.record;
  for (auto* text : {&record.id, &record.dataset, &record.split, &record.source, &record.species,
                     &record.image_path, &record.image_ref, &record.mask_path, &record.failure_detail,
                     &candidate.image_sha256, &candidate.mask_sha256, &candidate.finding}) {
    visitor(*text);
  }
  visitor(record.family);
  visitor(record.width_px);
  visitor(record.height_px);
  visitor(record.orientation);
  visitor(record.scale);
  visitor(record.box);
  visitor(record.keypoints);
  visitor(record.failure);
  visitor(candidate.role);
}

}  // namespace

void append_bytes(const Candidate& candidate, std::vector<std::byte>& bytes) {
  manifests::BytesWriter writer(bytes);
  visit(candidate, writer);
  writer(candidate.record.truth.has_value());
  if (candidate.record.truth) writer(*candidate.record.truth);
}

Candidate take_candidate(std::span<const std::byte>& bytes) {
  Candidate candidate;
  manifests::BytesReader reader(bytes);
  visit(candidate, reader);
  bool has_truth = false;
  reader(has_truth);
  if (has_truth) reader(candidate.record.truth.emplace());
  return candidate;
}

}  // namespace q3d::pipeline::candidates
