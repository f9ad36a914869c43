#include "pipeline/feed/pool_check.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <utility>

#include "loaders/pictures/encode.h"
#include "manifests/dataset_document.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::feed {
namespace {

namespace fs = std::filesystem;

// The largest box is wider than any picture that can be decoded (a picture has at most 200 million pixels).
constexpr double kSmallestSidePx = 1e-3;
constexpr double kLargestSidePx = 1e7;

// The digests of shards that the dataset.json files state. Each file is read once.
class Listings {
 public:
  // Returns nothing if there is no dataset.
  const std::map<std::string, std::string>* of(const fs::path& dataset) {
    if (dataset.empty()) return nullptr;
    auto found = listings_.find(dataset);
    if (found == listings_.end()) found = listings_.emplace(dataset, read(dataset / "dataset.json")).first;
    return found->second ? &*found->second : nullptr;
  }

 private:
  using Listing = std::map<std::string, std::string>;  // digests by file name
  static std::optional<Listing> read(const fs::path& file) {
    if (!fs::exists(file)) return std::nullopt;
    Listing listing;
    for (const manifests::ListedShard& shard : manifests::read_listed_shards(file)) {
      listing[fs::path(shard.file).filename()] = shard.sha256;
    }
    return listing;
  }

  std::map<fs::path, std::optional<Listing>> listings_;
};

// Returns the folder of the dataset to which a shard belongs, judging by its path; empty if it belongs to
// none.
fs::path dataset_of(const fs::path& shard) {
  const fs::path folder = fs::absolute(shard).parent_path();
  return folder.filename() == "shards" ? folder.parent_path() : fs::path();
}

std::string problem_of(const fs::path& file, const std::string& sha256,
                       const std::map<std::string, std::string>* listing) {
  if (listing == nullptr) return {};
  const auto listed = listing->find(file.filename());
  if (listed == listing->end()) return "dataset.json does not list it";
  if (listed->second == sha256) return {};
  return fmt::format("its SHA-256 is {}, dataset.json says {}", sha256, listed->second);
}

// Adds the shards that are listed but do not exist.
void add_missing(const fs::path& dataset, const std::map<std::string, std::string>& listing,
                 std::vector<CheckedShard>& shards) {
  for (const auto& [name, digest] : listing) {
    const fs::path file = dataset / "shards" / name;
    if (!fs::exists(file)) shards.push_back({file, "", "it is gone, and dataset.json lists it"});
  }
}

bool is_finite(std::span<const float> numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](float number) { return std::isfinite(number); });
}

std::string problem_of(const TrainingSample& sample, bool decode) {
  const loaders::pictures::SquareBox& box = sample.box;
  const bool has_size = box.side_px >= kSmallestSidePx && box.side_px <= kLargestSidePx;
  if (!has_size || !(std::abs(box.center_x_px) <= kLargestSidePx) ||
      !(std::abs(box.center_y_px) <= kLargestSidePx)) {
    return fmt::format("its box has the centre ({}, {}) and the side {} px, expected a side of {} to {} px",
                       box.center_x_px, box.center_y_px, box.side_px, kSmallestSidePx, kLargestSidePx);
  }
  for (const double number : sample.crop_from_image) {
    if (!std::isfinite(number)) return fmt::format("crop_from_image holds {}", number);
  }
  for (const manifests::Keypoint& keypoint : sample.keypoints) {
    if (keypoint.weight == 0.0F) continue;
    if (!std::isfinite(keypoint.x_px) || !std::isfinite(keypoint.y_px) || !std::isfinite(keypoint.weight) ||
        !std::isfinite(keypoint.v)) {
      return fmt::format("a keypoint is ({}, {}) with the weight {}", keypoint.x_px, keypoint.y_px,
                         keypoint.weight);
    }
  }
  if (sample.has_pose && !is_finite(sample.pose)) return "its pose is not finite";
  if (sample.has_betas && !is_finite(sample.betas)) return "its betas are not finite";
  if (sample.has_keypoints_3d && !is_finite(sample.keypoints_3d)) return "its 3D keypoints are not finite";
  if (!decode) return {};
  try {
    loaders::pictures::decode_stored(sample.crop, 3);
  } catch (const std::runtime_error& error) {
    return fmt::format("its stored crop cannot be decoded: {}", error.what());
  }
  return {};
}

}  // namespace

std::vector<CheckedShard> check_shards(const std::vector<fs::path>& sources) {
  Listings listings;
  std::vector<CheckedShard> shards;
  std::set<fs::path> whole;  // datasets of which a source takes all shards
  for (const fs::path& source : sources) {
    for (const fs::path& file : shard_files({source})) {
      run::throw_if_interrupted();
      const fs::path dataset = dataset_of(file);
      const auto* listing = listings.of(dataset);
      CheckedShard& shard = shards.emplace_back();
      shard.file = file;
      shard.sha256 = manifests::sha256_file(file);
      shard.problem = problem_of(file, shard.sha256, listing);
      if (listing == nullptr || fs::is_regular_file(source) || !whole.insert(dataset).second) continue;
      add_missing(dataset, *listing, shards);
    }
  }
  return shards;
}

std::vector<DamagedRecord> find_damaged_records(const ShardPool& pool, bool decode) {
  std::vector<std::string> problems(static_cast<std::size_t>(pool.size()));
  tbb::parallel_for(std::int64_t{0}, pool.size(), [&](std::int64_t position) {
    if (run::interrupted()) return;
    std::string& problem = problems[static_cast<std::size_t>(position)];
    try {
      problem = problem_of(pool.sample(position), decode);
    } catch (const manifests::IoError& error) {
      if (error.code() != 0) throw;  // a failure of the disk, not of the record
      problem = error.what();
    } catch (const std::runtime_error& error) {
      problem = error.what();
    }
  });
  run::throw_if_interrupted();
  std::vector<DamagedRecord> damaged;
  for (std::int64_t position = 0; position < pool.size(); ++position) {
    std::string& problem = problems[static_cast<std::size_t>(position)];
    if (!problem.empty()) damaged.push_back({position, pool.id(position), std::move(problem)});
  }
  return damaged;
}

}  // namespace q3d::pipeline::feed
