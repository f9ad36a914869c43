#include "pipeline/leakage/leakage_lists.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "manifests/atomic_file.h"
#include "manifests/csv.h"

namespace q3d::pipeline::leakage {
namespace {

using manifests::csv_cell;
using nlohmann::ordered_json;

std::string leaks_csv(const LeakageReport& report, const candidates::Ingest& pool) {
  std::string text = "id,test_id,evidence,detail,role\n";
  for (const Leak& leak : report.leaks) {
    const candidates::Candidate candidate = pool.candidates.at(leak.candidate);
    text += fmt::format("{},{},{},{},{}\n", csv_cell(candidate.record.id), csv_cell(leak.test_id),
                        to_string(leak.evidence), csv_cell(leak.detail), to_string(candidate.role));
  }
  return text;
}

std::string duplicates_csv(const LeakageReport& report, const candidates::Ingest& pool) {
  std::string text = "group,id\n";
  for (std::size_t i = 0; i < report.groups.size(); ++i) {
    for (const std::size_t sample : report.groups[i]) {
      text += fmt::format("{},{}\n", i, csv_cell(pool.candidates.at(sample).record.id));
    }
  }
  return text;
}

ordered_json leakage_json(const LeakageReport& report, const candidates::Ingest& pool) {
  ordered_json leaks = ordered_json::array();
  for (const Leak& leak : report.leaks) {
    const candidates::Candidate candidate = pool.candidates.at(leak.candidate);
    leaks.push_back({{"id", candidate.record.id},
                     {"test_id", leak.test_id},
                     {"evidence", to_string(leak.evidence)},
                     {"detail", leak.detail},
                     {"role", to_string(candidate.role)}});
  }
  ordered_json groups = ordered_json::array();
  for (const auto& group : report.groups) {
    ordered_json ids = ordered_json::array();
    for (const std::size_t sample : group) ids.push_back(pool.candidates.at(sample).record.id);
    groups.push_back(std::move(ids));
  }
  return {{"candidates", pool.candidates.size()},
          {"pool_pictures", report.pool_pictures},
          {"test_pictures", report.summary.test_pictures},
          {"test_sets", report.summary.test_sets},
          {"leaks_by_evidence", count_by_evidence(report)},
          {"leaks", leaks},
          {"groups", groups}};
}

}  // namespace

std::map<std::string, std::size_t> count_by_evidence(const LeakageReport& report) {
  std::map<std::string, std::size_t> counts;
  for (const Leak& leak : report.leaks) ++counts[std::string(to_string(leak.evidence))];
  return counts;
}

void write_leakage_lists(const std::filesystem::path& folder, const LeakageReport& report,
                         const candidates::Ingest& pool) {
  manifests::write_file_atomically(folder / "leaks.csv", leaks_csv(report, pool));
  manifests::write_file_atomically(folder / "duplicates.csv", duplicates_csv(report, pool));
  manifests::write_file_atomically(folder / "leakage.json", leakage_json(report, pool).dump(1) + "\n");
}

}  // namespace q3d::pipeline::leakage
