// Candidates as bytes, for a file that lives no longer than its process.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pipeline/candidates/candidate.h"

namespace q3d::pipeline::candidates {

// Appends all of the candidate but its exclusion, bit for bit.
void append_bytes(const Candidate& candidate, std::vector<std::byte>& bytes);

// Takes the first candidate off the bytes. Throws std::out_of_range if they end within it.
Candidate take_candidate(std::span<const std::byte>& bytes);

}  // namespace q3d::pipeline::candidates
