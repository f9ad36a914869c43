// `merge` and `subset`: make a new version from candidates of finished ones.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/derived/derived_version.h"

namespace q3d::pipeline::derived {

struct MergeSummary {
  DerivedVersion version;
  std::vector<std::string>
      repeated_ids;                // candidates of a later version whose id an earlier one has: left out
  std::int64_t same_pictures = 0;  // candidates of a later version whose picture an earlier one has too,
                                   // under another id: kept
};

// Joins versions. If several candidates have the same id, that of the first version is taken. An empty `name`
// joins the sources' names by "+". Throws as write_derived does.
MergeSummary merge(const std::vector<std::filesystem::path>& versions, const std::filesystem::path& out,
                   const std::string& name, const std::string& version);

// Makes a version of the candidates that fulfil a condition (where.h). An empty `name` takes the source's.
// Throws as parse_where and write_derived do.
DerivedVersion subset(const std::filesystem::path& version_folder, const std::string& where,
                      const std::filesystem::path& out, const std::string& name, const std::string& version);

}  // namespace q3d::pipeline::derived
