// Converts candidates to bytes and back, for a file that lives no longer than its process.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "pipeline/candidates/candidate.h"

namespace q3d::pipeline::candidates {

// Appends the candidate without its exclusion, bit for bit.
void append_bytes(const Candidate& candidate, std::vector<std::byte>& bytes);

// Reads the first candidate and removes it from the bytes. Throws std::out_of_range if they end within it.
Candidate take_candidate(std::span<const std::byte>& bytes);

}  // namespace q3d::pipeline::candidates
