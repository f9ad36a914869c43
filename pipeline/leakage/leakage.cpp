#include "pipeline/leakage/leakage.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "filters/near_duplicates.h"
#include "loaders/formats/picture_origin.h"
#include "pipeline/leakage/picture_hashes.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::leakage {
namespace {

using manifests::PictureHash;
using manifests::SampleRecord;

// One picture file, whatever the number of animals in it.
struct Picture {
  std::size_t sample = 0;  // its first one, by the caller's count
  std::string id;          // of that
  std::string path;
  std::string sha256;
  int orientation = 1;  // by which its dataset turns it
  std::string origin;
  std::vector<std::size_t> elsewhere;  // the first sample of each other file of the same content

  PictureFile file() const { return {path, sha256, orientation}; }
};

struct Pictures {
  std::vector<Picture> list;
  std::unordered_map<std::string, std::size_t> of_sha256;
  std::unordered_set<std::string> other_paths;

  // Adds a sample and returns the position of its picture. The first sample of a picture gives the id; a
  // later one may give the origin if it is missing.
  std::size_t add(std::size_t sample, const SampleRecord& record, const std::string& sha256) {
    const auto [found, is_new] = of_sha256.emplace(sha256, list.size());
    if (is_new) list.push_back({sample, record.id, record.image_path, sha256, record.orientation, {}, {}});
    Picture& picture = list[found->second];
    if (record.image_path != picture.path && other_paths.insert(record.image_path).second) {
      picture.elsewhere.push_back(sample);
    }
    if (picture.origin.empty()) picture.origin = loaders::formats::picture_origin(record.image_ref);
    return found->second;
  }

  std::vector<PictureFile> files() const {
    std::vector<PictureFile> files;
    for (const Picture& picture : list) files.push_back(picture.file());
    return files;
  }
};

// Reads the test sets. A record that failed for a reason other than its picture still shows that the test set
// holds this picture.
Pictures read_test_sets(const config::LeakageConfig& config, manifests::DigestCache& digests,
                        LeakageReport& report) {
  Pictures pictures;
  for (const config::DatasetConfig& options : config.test_sets) {
    const candidates::IngestedDataset ingested = candidates::read_dataset(options, digests);
    const loaders::formats::Dataset& dataset = ingested.dataset;
    const std::string name = options.name + "/" + options.split;
    report.summary.test_sets[name] = ingested.annotations_sha256;
    std::vector<std::string> shas(dataset.records.size());
    tbb::parallel_for(std::size_t{0}, shas.size(), [&](std::size_t i) {
      if (dataset.records[i].image_path.empty() || run::interrupted()) return;
      shas[i] = digests.digest_if_present(dataset.records[i].image_path).value_or("");  // "": reported below
    });
    run::throw_if_interrupted();
    for (std::size_t i = 0; i < shas.size(); ++i) {
      if (!shas[i].empty()) pictures.add(i, dataset.records[i], shas[i]);
    }
    const auto unread = std::count(shas.begin(), shas.end(), std::string());
    if (unread > 0) {
      report.notes.push_back(fmt::format(
          "{}: samples of the test set whose picture cannot be read, so that copies of it are not seen: {}",
          name, unread));
    }
  }
  report.summary.test_pictures = pictures.list.size();
  digests.save();
  return pictures;
}

// The pictures that have a hash, and their hashes.
struct HashedPictures {
  std::vector<PictureHash> hashes;
  std::vector<std::size_t> places;

  HashedPictures(const Pictures& pictures, const PictureHashes& known) {
    for (std::size_t i = 0; i < pictures.list.size(); ++i) {
      const auto hash = known.find(pictures.list[i].file().key());
      if (!hash) continue;
      hashes.push_back(*hash);
      places.push_back(i);
    }
  }

  std::vector<std::uint64_t> hashes_upright() const {
    std::vector<std::uint64_t> upright;
    for (const PictureHash& hash : hashes) upright.push_back(hash.upright);
    return upright;
  }
};

// The test picture of which a picture of the pool is a copy.
struct Copy {
  std::size_t test_picture = 0;
  CopyEvidence evidence = CopyEvidence::same_file;
  std::string detail;
};

std::vector<std::optional<Copy>> find_copies(const Pictures& pool, const Pictures& tests,
                                             const PictureHashes& known, int max_distance) {
  std::vector<std::optional<Copy>> copies(pool.list.size());
  const HashedPictures hashed(pool, known);
  const HashedPictures references(tests, known);
  const filters::HashIndex index(references.hashes_upright(), max_distance);
  tbb::parallel_for(std::size_t{0}, hashed.hashes.size(), [&](std::size_t i) {
    const auto alike = filters::nearest_likeness(index, hashed.hashes[i]);
    if (!alike) return;
    copies[hashed.places[i]] = {
        references.places[alike->position], CopyEvidence::looks_alike,
        fmt::format("{} of 64 bits differ{}", alike->distance, alike->mirrored ? ", mirrored" : "")};
  });
  std::unordered_map<std::string, std::size_t> of_origin;
  for (std::size_t i = 0; i < tests.list.size(); ++i) {
    if (!tests.list[i].origin.empty()) of_origin.emplace(tests.list[i].origin, i);
  }
  for (std::size_t i = 0; i < pool.list.size(); ++i) {
    const auto named = of_origin.find(pool.list[i].origin);
    if (named != of_origin.end()) copies[i] = {named->second, CopyEvidence::same_origin, named->first};
    const auto same = tests.of_sha256.find(pool.list[i].sha256);
    if (same != tests.of_sha256.end()) copies[i] = {same->second, CopyEvidence::same_file, "SHA-256"};
  }
  return copies;
}

// Adds the groups of pictures that look alike. Files with the same content also form a group, although they
// count as one picture elsewhere in this file.
void add_groups(const Pictures& pool, const PictureHashes& known, int max_distance, LeakageReport& report) {
  std::vector<bool> is_grouped(pool.list.size());
  const auto add_files = [&](std::size_t place, std::vector<std::size_t>& samples) {
    const Picture& picture = pool.list[place];
    is_grouped[place] = true;
    samples.push_back(picture.sample);
    samples.insert(samples.end(), picture.elsewhere.begin(), picture.elsewhere.end());
  };
  const HashedPictures hashed(pool, known);
  for (const auto& group : filters::groups_alike(hashed.hashes, max_distance)) {
    std::vector<std::size_t>& samples = report.groups.emplace_back();
    for (const std::uint32_t member : group) add_files(hashed.places[member], samples);
  }
  for (std::size_t i = 0; i < pool.list.size(); ++i) {
    if (!is_grouped[i] && !pool.list[i].elsewhere.empty()) add_files(i, report.groups.emplace_back());
  }
  for (auto& group : report.groups) {
    std::sort(group.begin(), group.end());
    report.summary.in_groups += group.size();
  }
  std::sort(report.groups.begin(), report.groups.end());
  report.summary.groups = report.groups.size();
}

}  // namespace

std::string_view to_string(CopyEvidence evidence) {
  constexpr std::array<std::string_view, 3> kNames{"same file", "same origin", "looks alike"};
  return kNames.at(static_cast<std::size_t>(evidence));
}

LeakageReport find_leaks(const config::LeakageConfig& config, const candidates::Ingest& pool,
                         manifests::DigestCache& digests, const std::filesystem::path& cache_folder,
                         bool quiet) {
  LeakageReport report;
  const Pictures tests = read_test_sets(config, digests, report);
  Pictures pictures;
  constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  std::vector<std::size_t> picture_of(pool.candidates.size(), kNone);
  pool.candidates.for_each([&](std::size_t i, const candidates::Candidate& candidate) {
    if (!candidate.image_sha256.empty())
      picture_of[i] = pictures.add(i, candidate.record, candidate.image_sha256);
  });
  report.pool_pictures = pictures.list.size();

  PictureHashes hashes(cache_folder / "picture_hashes.txt");
  std::vector<PictureFile> files = pictures.files();
  const std::vector<PictureFile> more = tests.files();
  files.insert(files.end(), more.begin(), more.end());
  hashes.add(files, quiet);

  const auto copies = find_copies(pictures, tests, hashes, config.max_distance);
  for (std::size_t i = 0; i < picture_of.size(); ++i) {
    if (picture_of[i] == kNone || !copies[picture_of[i]]) continue;
    const Copy& copy = *copies[picture_of[i]];
    const Picture& test = tests.list[copy.test_picture];
    report.leaks.push_back({i, test.id, test.path, copy.evidence, copy.detail});
  }
  add_groups(pictures, hashes, config.max_distance, report);
  return report;
}

}  // namespace q3d::pipeline::leakage
