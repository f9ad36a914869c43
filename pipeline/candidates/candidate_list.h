// The candidates of a run, in order. They are kept on disk, so that memory does not limit their number.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/spill_file.h"
#include "pipeline/candidates/candidate.h"

namespace q3d::pipeline::candidates {

// In memory, a candidate takes eight bytes for its position in the file, plus the values that were set after
// it was appended. Reading is thread-safe; all other calls must come from one thread, while no other thread
// reads. Members that access the disk throw manifests::IoError.
class CandidateList {
 public:
  // Candidates go to a file without a name in `folder` (manifests/spill_file.h), which is made when the first
  // one is appended.
  explicit CandidateList(std::filesystem::path folder = ".") : folder_(std::move(folder)) {}

  void append(std::span<const Candidate> candidates);
  std::size_t size() const { return places_.empty() ? 0 : places_.size() - 1; }

  // `first` and `count` must lie within the list.
  std::vector<Candidate> read(std::size_t first, std::size_t count) const;
  Candidate at(std::size_t index) const { return std::move(read(index, 1).front()); }
  // Calls `look` for every candidate in order, with its place.
  void for_each(const std::function<void(std::size_t, const Candidate&)>& look) const;

  void fail(std::size_t index, manifests::Reason reason, std::string detail);
  void exclude(std::size_t index, Exclusion exclusion);
  const std::map<std::size_t, Exclusion>& exclusions() const { return exclusions_; }  // by place

 private:
  struct Failure {
    manifests::Reason reason = manifests::Reason::none;
    std::string detail;
  };

  std::filesystem::path folder_;
  std::optional<manifests::SpillFile> file_;
  std::deque<std::uint64_t> places_;  // of each candidate in the file, and the end of the last
  std::map<std::size_t, Failure> failures_;
  std::map<std::size_t, Exclusion> exclusions_;
};

}  // namespace q3d::pipeline::candidates
