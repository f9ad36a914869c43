// Writes the results of `leakage` as files: leaks.csv, duplicates.csv and leakage.json.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "pipeline/leakage/leakage.h"

namespace q3d::pipeline::leakage {

// Returns the number of candidates by evidence ("same file", "same origin", "looks alike"). Evidence that
// does not occur is absent.
std::map<std::string, std::size_t> count_by_evidence(const LeakageReport& report);

// Writes the three files into `folder`. They hold sample ids, but nothing about this machine or the time, so
// equal pools give equal bytes. Throws std::runtime_error.
void write_leakage_lists(const std::filesystem::path& folder, const LeakageReport& report,
                         const candidates::Ingest& pool);

}  // namespace q3d::pipeline::leakage
