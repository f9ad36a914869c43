// Writes what leakage found as files: leaks.csv, duplicates.csv and leakage.json.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "pipeline/leakage/leakage.h"

namespace q3d::pipeline::leakage {

// Candidates by evidence ("same file", "same origin", "looks alike"); absent ones have none.
std::map<std::string, std::size_t> count_by_evidence(const LeakageReport& report);

// Writes the three into `folder`. They hold sample ids, and nothing of this machine or of the time: equal
// pools give equal bytes. Throws std::runtime_error.
void write_leakage_lists(const std::filesystem::path& folder, const LeakageReport& report,
                         const candidates::Ingest& pool);

}  // namespace q3d::pipeline::leakage
