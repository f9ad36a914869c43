// Writes a page that shows the pairs and groups that leakage found.
#pragma once

#include <filesystem>

#include "pipeline/leakage/leakage.h"

namespace q3d::pipeline::leakage {

// Writes one HTML file with small pictures inside it. It shows each copy beside its test picture, then the
// groups of the pool. It shows only the first of each and says so; the lists hold all. Throws
// std::runtime_error.
void write_leakage_page(const std::filesystem::path& file, const LeakageReport& report,
                        const candidates::Ingest& pool);

}  // namespace q3d::pipeline::leakage
