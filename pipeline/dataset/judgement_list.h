// The verdicts of a run, unit by unit. They are kept on disk, so that memory does not limit their number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "manifests/spill_file.h"
#include "manifests/verdict.h"
#include "pipeline/candidates/ingest.h"

namespace q3d::pipeline::dataset {

// Members that access the disk throw manifests::IoError.
class JudgementList {
 public:
  // The verdicts go to a file without a name in `folder` (manifests/spill_file.h), which is made with the
  // first of them.
  JudgementList(std::filesystem::path folder, std::size_t units)
      : folder_(std::move(folder)), places_(units) {}

  // Sets the verdicts of a unit's candidates, in any order of the units.
  void set(std::int64_t unit, std::span<const manifests::Judgement> judgements);
  bool has(std::int64_t unit) const { return places_.at(static_cast<std::size_t>(unit)).has_value(); }
  std::size_t units() const { return places_.size(); }
  // Returns the verdicts of a unit. Throws std::logic_error if it has none yet.
  std::vector<manifests::Judgement> of(std::int64_t unit) const;

 private:
  struct Place {
    std::uint64_t offset = 0;
    std::uint64_t bytes = 0;
    std::size_t count = 0;
  };
  std::filesystem::path folder_;
  std::optional<manifests::SpillFile> file_;
  std::vector<std::optional<Place>> places_;  // by unit
};

// Calls `look` for every candidate of the pool in order, with its unit and its verdict.
using LookAtVerdict =
    std::function<void(const candidates::Unit&, const candidates::Candidate&, const manifests::Judgement&)>;
void for_each_verdict(const candidates::Ingest& ingest, const JudgementList& judgements,
                      const LookAtVerdict& look);

}  // namespace q3d::pipeline::dataset
