// The pairs and groups that leakage found, to look at.
#pragma once

#include <filesystem>

#include "pipeline/leakage/leakage.h"

namespace q3d::pipeline::leakage {

// One HTML file with the pictures inside it, small: each copy beside the test picture it is a copy of, then
// the groups of the pool. The first of each only, which it says; the lists hold all. Throws
// std::runtime_error.
void write_leakage_page(const std::filesystem::path& file, const LeakageReport& report,
                        const candidates::Ingest& pool);

}  // namespace q3d::pipeline::leakage
