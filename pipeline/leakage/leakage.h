// Finds pictures of the pool that are also in test sets, and pictures of the pool that look alike.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/digest.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::leakage {

// The ways in which a copy is recognised, the surest first.
enum class CopyEvidence { same_file, same_origin, looks_alike };
std::string_view to_string(CopyEvidence evidence);  // same file, same origin, looks alike

// A candidate whose picture is in a test set.
struct Leak {
  std::size_t candidate = 0;  // into Ingest::candidates
  std::string test_id;        // the first sample of that picture
  std::string test_path;      // of the picture
  CopyEvidence evidence = CopyEvidence::same_file;
  std::string detail;  // for people: the common name, or the distance
};

struct LeakageReport {
  std::vector<Leak> leaks;  // sorted by candidate; at most one for each, with the surest evidence
  // Groups of files of the pool that look alike or have the same content. A group has two or more files, each
  // given by its first candidate, in ascending order. Groups are sorted by their first member.
  std::vector<std::vector<std::size_t>> groups;
  candidates::LeakageSummary summary;
  std::vector<std::string> notes;
  std::size_t pool_pictures = 0;  // distinct files
};

// Reads the test sets, hashes every picture that has no hash yet (kept in `cache_folder`/picture_hashes.txt),
// and compares the pool with them and with itself. Memory is below 1 kB for each picture, plus one decoded
// picture for each thread. The report is the same for any number of threads. Throws ConfigError,
// std::runtime_error, Interrupted.
LeakageReport find_leaks(const config::LeakageConfig& config, const candidates::Ingest& pool,
                         manifests::DigestCache& digests, const std::filesystem::path& cache_folder,
                         bool quiet);

}  // namespace q3d::pipeline::leakage
