// Handles the journals of single ranks. Ranks that share a build write into the same stage folders, but a
// journal has one writer only. So each rank has its own journals: journal.jsonl.<run>.<rank>. At the end,
// rank 0 moves their lines into journal.jsonl. If it ended before that, the next run does so before its first
// unit.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/journal.h"

namespace q3d::pipeline::stages {

std::filesystem::path rank_journal(const std::filesystem::path& folder, const std::string& run, int rank);

// Returns the journals of ranks in the folder, sorted by name. Throws std::filesystem::filesystem_error.
std::vector<std::filesystem::path> find_rank_journals(const std::filesystem::path& folder);

// Adds the lines of the ranks' journals to `journal`, whose file is unchanged. Two ranks may have made the
// same unit. If their lines differ, the line that matches the existing file counts; the file is read for
// that. Throws manifests::IoError.
void adopt_rank_journals(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& files,
                         manifests::Journal& journal);

}  // namespace q3d::pipeline::stages
