#include "pipeline/candidates/candidate_list.h"

#include <algorithm>
#include <utility>

#include "pipeline/candidates/candidate_bytes.h"

namespace q3d::pipeline::candidates {
namespace {

// The number of candidates that for_each() reads at once.
constexpr std::size_t kBlock = 512;

// Applies the values that were set later to the candidates of a part of the list.
template <typename Values, typename Set>
void apply(const Values& values, std::size_t first, std::vector<Candidate>& part, Set set) {
  for (auto value = values.lower_bound(first); value != values.end() && value->first < first + part.size();
       ++value) {
    set(part[value->first - first], value->second);
  }
}

}  // namespace

void CandidateList::append(std::span<const Candidate> candidates) {
  if (candidates.empty()) return;
  if (!file_) {
    file_.emplace(folder_);
    places_.push_back(0);
  }
  std::vector<std::byte> bytes;
  const std::uint64_t begin = file_->size();
  for (const Candidate& candidate : candidates) {
    if (candidate.exclusion.reason != manifests::Reason::none) exclude(size(), candidate.exclusion);
    append_bytes(candidate, bytes);
    places_.push_back(begin + bytes.size());
  }
  file_->append(bytes);
}

std::vector<Candidate> CandidateList::read(std::size_t first, std::size_t count) const {
  std::vector<Candidate> part;
  if (count == 0) return part;
  std::vector<std::byte> bytes(places_.at(first + count) - places_.at(first));
  file_->read(places_[first], bytes);
  part.reserve(count);
  std::span<const std::byte> rest = bytes;
  while (part.size() < count) part.push_back(take_candidate(rest));
  apply(failures_, first, part, [](Candidate& candidate, const Failure& failure) {
    candidate.record.failure = failure.reason;
    candidate.record.failure_detail = failure.detail;
  });
  apply(exclusions_, first, part,
        [](Candidate& candidate, const Exclusion& exclusion) { candidate.exclusion = exclusion; });
  return part;
}

void CandidateList::for_each(const std::function<void(std::size_t, const Candidate&)>& look) const {
  for (std::size_t first = 0; first < size(); first += kBlock) {
    const std::vector<Candidate> part = read(first, std::min(kBlock, size() - first));
    for (std::size_t i = 0; i < part.size(); ++i) look(first + i, part[i]);
  }
}

void CandidateList::fail(std::size_t index, manifests::Reason reason, std::string detail) {
  failures_.insert_or_assign(index, Failure{reason, std::move(detail)});
}

void CandidateList::exclude(std::size_t index, Exclusion exclusion) {
  exclusions_.insert_or_assign(index, std::move(exclusion));
}

}  // namespace q3d::pipeline::candidates
