// Finds animals that a pool holds several times, because two files have the same labels or one annotation
// occurs twice.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include "pipeline/candidates/candidate_list.h"
#include "pipeline/candidates/ingest.h"

namespace q3d::pipeline::candidates {

// Candidates of different roles are not compared: a pool may hold an animal's own label and its pseudo label.
class Duplicates {
 public:
  // Remembers the candidate by its picture's digest if it is usable and has a picture. Every candidate must
  // be added, in order.
  void add(std::size_t index, const Candidate& candidate);

  // Fails every candidate as `duplicate` whose picture has the bytes of an earlier candidate's and whose
  // visible keypoints, or whose box if it has none, are the same to half a pixel. Samples of one picture that
  // look like one animal labelled by two people are kept. Adds notes of both for each dataset. Call it once.
  void fail(CandidateList& candidates, std::vector<IngestNote>& notes);

 private:
  struct Pictured {
    std::uint64_t picture = 0;  // the first digits of its SHA-256
    std::size_t index = 0;
    auto operator<=>(const Pictured&) const = default;
  };
  std::deque<Pictured> pictured_;
};

}  // namespace q3d::pipeline::candidates
