#include "pipeline/stages/rank_journals.h"

#include <fmt/format.h>

#include <algorithm>

#include "manifests/digest.h"
#include "manifests/file_descriptor.h"

namespace q3d::pipeline::stages {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPrefix = "journal.jsonl.";

bool holds(const fs::path& folder, const manifests::JournalEntry& entry) {
  try {
    return manifests::sha256_file(folder / entry.file) == entry.sha256;
  } catch (const manifests::IoError& error) {
    if (error.names_no_file()) return false;
    throw;
  }
}

}  // namespace

fs::path rank_journal(const fs::path& folder, const std::string& run, int rank) {
  return folder / fmt::format("{}{}.{}", kPrefix, run, rank);
}

std::vector<fs::path> find_rank_journals(const fs::path& folder) {
  std::vector<fs::path> files;
  if (!fs::is_directory(folder)) return files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(kPrefix) && !name.ends_with(".tmp")) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

void adopt_rank_journals(const fs::path& folder, const std::vector<fs::path>& files,
                         manifests::Journal& journal) {
  for (const fs::path& file : files) {
    const manifests::Journal of_rank(file);
    for (const auto& [unit, entry] : of_rank.entries()) {
      const auto known = journal.entries().find(unit);
      const bool differs = known != journal.entries().end() && known->second.sha256 != entry.sha256;
      if (!differs || holds(folder, entry)) journal.adopt(entry);
    }
  }
}

}  // namespace q3d::pipeline::stages
