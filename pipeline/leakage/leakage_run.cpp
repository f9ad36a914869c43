#include "pipeline/leakage/leakage_run.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "manifests/atomic_file.h"
#include "manifests/lock.h"
#include "pipeline/leakage/leakage.h"
#include "pipeline/leakage/leakage_lists.h"
#include "pipeline/leakage/leakage_page.h"

namespace q3d::pipeline::leakage {
LeakageRunSummary run_leakage(const config::BuildConfig& config, const run::RunOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    options.threads > 0
                                        ? static_cast<std::size_t>(options.threads)
                                        : std::max<std::size_t>(1, std::thread::hardware_concurrency()));
  std::filesystem::create_directories(options.out);
  const manifests::FolderLock lock(options.out);
  manifests::remove_temporaries(options.out);  // of a killed run
  manifests::DigestCache digests(options.out / "digests.txt");
  const candidates::Ingest pool = candidates::ingest(config, digests, /*load_bodies=*/{}, options.out);
  const LeakageReport report =
      find_leaks(config.leakage.value_or(config::LeakageConfig{}), pool, digests, options.out, options.quiet);
  write_leakage_lists(options.out, report, pool);
  write_leakage_page(options.out / "leakage.html", report, pool);
  LeakageRunSummary summary;
  summary.candidates = pool.candidates.size();
  summary.pool_pictures = report.pool_pictures;
  summary.test_pictures = report.summary.test_pictures;
  summary.leaks_by_evidence = count_by_evidence(report);
  summary.groups = report.groups.size();
  summary.pictures_in_groups = report.summary.in_groups;
  for (const candidates::IngestNote& note : pool.notes) summary.notes.push_back(note.line());
  summary.notes.insert(summary.notes.end(), report.notes.begin(), report.notes.end());
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace q3d::pipeline::leakage
