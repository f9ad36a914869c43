// Journals of single ranks. Ranks that share a build write into the same stage folders, and a journal has one
// writer only, so each rank has journals of its own: journal.jsonl.<run>.<rank>. Rank 0 takes their lines
// over into journal.jsonl at the end. Where it did not come to that, the next run does so before its first
// unit.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/journal.h"

namespace q3d::pipeline::stages {

std::filesystem::path rank_journal(const std::filesystem::path& folder, const std::string& run, int rank);

// The journals of ranks that lie in the folder, in the order of their names. Throws
// std::filesystem::filesystem_error.
std::vector<std::filesystem::path> find_rank_journals(const std::filesystem::path& folder);

// Counts the lines of the ranks' journals as lines of `journal`, whose file stays as it is. Two ranks may
// have made one unit. Where their files differ, the line counts whose file is there, which must be read for
// that. Throws manifests::IoError.
void adopt_rank_journals(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& files,
                         manifests::Journal& journal);

}  // namespace q3d::pipeline::stages
