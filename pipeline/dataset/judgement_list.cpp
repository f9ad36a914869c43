#include "pipeline/dataset/judgement_list.h"

#include <fmt/format.h>

#include <cstddef>
#include <stdexcept>

#include "manifests/spill_bytes.h"

namespace q3d::pipeline::dataset {
namespace {

using manifests::Judgement;

// Visits every member, so that writing and reading share one list.
template <typename SomeJudgement, typename Visitor>
void visit(SomeJudgement& judgement, Visitor&& visitor) {
  visitor(judgement.verdict);
  visitor(judgement.reason);
  visitor(judgement.detail);
  visitor(judgement.initial_error);
  visitor(judgement.final_error);
  visitor(judgement.gain);
  visitor(judgement.iterations);
  visitor(judgement.best_iteration);
  visitor(judgement.trust);
}

}  // namespace

void JudgementList::set(std::int64_t unit, std::span<const Judgement> judgements) {
  if (!file_) file_.emplace(folder_);
  std::vector<std::byte> bytes;
  for (const Judgement& judgement : judgements) visit(judgement, manifests::BytesWriter(bytes));
  const std::uint64_t offset = file_->append(bytes);
  places_.at(static_cast<std::size_t>(unit)) = Place{offset, bytes.size(), judgements.size()};
}

std::vector<Judgement> JudgementList::of(std::int64_t unit) const {
  if (!has(unit)) throw std::logic_error(fmt::format("unit {} has no verdicts yet", unit));
  const Place& place = *places_[static_cast<std::size_t>(unit)];
  std::vector<std::byte> bytes(place.bytes);
  file_->read(place.offset, bytes);
  std::span<const std::byte> rest = bytes;
  std::vector<Judgement> judgements(place.count);
  for (Judgement& judgement : judgements) visit(judgement, manifests::BytesReader(rest));
  return judgements;
}

void for_each_verdict(const candidates::Ingest& ingest, const JudgementList& judgements,
                      const LookAtVerdict& look) {
  for (const candidates::Unit& unit : ingest.units) {
    const std::vector<candidates::Candidate> candidates = ingest.candidates.read(unit.first, unit.count);
    const std::vector<Judgement> own = judgements.of(unit.index);
    for (std::size_t i = 0; i < candidates.size(); ++i) look(unit, candidates[i], own.at(i));
  }
}

}  // namespace q3d::pipeline::dataset
