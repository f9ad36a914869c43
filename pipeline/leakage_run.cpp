#include "pipeline/leakage_run.h"

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "manifests/atomic_file.h"
#include "manifests/csv.h"
#include "manifests/lock.h"
#include "pipeline/leakage.h"

namespace q3d::pipeline {
namespace {

using manifests::csv_cell;

std::string leaks_csv(const LeakageReport& report, const Ingest& ingest) {
  std::string text = "id,test_id,evidence,detail,role\n";
  for (const Leak& leak : report.leaks) {
    const Candidate& candidate = ingest.candidates[leak.candidate];
    text += fmt::format("{},{},{},{},{}\n", csv_cell(candidate.record.id), csv_cell(leak.test_id),
                        to_string(leak.evidence), csv_cell(leak.detail), to_string(candidate.role));
  }
  return text;
}

std::string duplicates_csv(const LeakageReport& report) {
  std::string text = "group,id\n";
  for (std::size_t i = 0; i < report.groups.size(); ++i) {
    for (const std::string& id : report.groups[i]) text += fmt::format("{},{}\n", i, csv_cell(id));
  }
  return text;
}

}  // namespace

LeakageRunSummary run_leakage(const BuildConfig& config, const RunOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    options.threads > 0
                                        ? static_cast<std::size_t>(options.threads)
                                        : std::max<std::size_t>(1, std::thread::hardware_concurrency()));
  std::filesystem::create_directories(options.out);
  const manifests::FolderLock lock(options.out);
  manifests::DigestCache digests(options.out / "digests.txt");
  const Ingest pool = ingest(config, digests);
  const LeakageReport report =
      find_leaks(config.leakage.value_or(LeakageConfig{}), pool, digests, options.out,
                 /*with_groups=*/true, options.quiet);
  digests.save();
  LeakageRunSummary summary;
  summary.leaks = options.out / "leaks.csv";
  summary.duplicates = options.out / "duplicates.csv";
  manifests::write_file_atomically(summary.leaks, leaks_csv(report, pool));
  manifests::write_file_atomically(summary.duplicates, duplicates_csv(report));
  summary.candidates = pool.candidates.size();
  summary.pool_pictures = report.pool_pictures;
  summary.test_pictures = report.summary.test_pictures;
  for (const Leak& leak : report.leaks) ++summary.leaks_by_evidence[std::string(to_string(leak.evidence))];
  summary.groups = report.groups.size();
  for (const auto& group : report.groups) summary.pictures_in_groups += group.size();
  summary.notes = pool.notes;
  summary.notes.insert(summary.notes.end(), report.notes.begin(), report.notes.end());
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace q3d::pipeline
