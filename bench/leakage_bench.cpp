// Hashing pictures and finding those that look alike. docs/leakage.md gives the numbers.

#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "filters/near_duplicates.h"
#include "loaders/pictures/encode.h"
#include "pipeline/leakage/picture_hashes.h"

namespace {

namespace fs = std::filesystem;
using namespace q3d;
using manifests::PictureHash;

double peak_megabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

// A 640 x 480 JPEG of shapes under grain, about as large as a photograph's (100 kB).
std::vector<std::byte> picture(unsigned seed) {
  std::mt19937 engine(seed);
  const auto draw = [&engine](unsigned below) { return static_cast<int>(engine() % below); };
  cv::Mat canvas(480, 640, CV_8UC3, cv::Scalar(90, 130, 80));
  for (int i = 0; i < 60; ++i) {
    cv::ellipse(canvas, {draw(640), draw(480)}, {10 + draw(120), 10 + draw(80)}, draw(180), 0, 360,
                cv::Scalar(draw(256), draw(256), draw(256)), cv::FILLED);
  }
  cv::Mat grain(canvas.size(), CV_16SC3);
  cv::RNG(seed).fill(grain, cv::RNG::NORMAL, 0, 8);
  cv::add(canvas, grain, canvas, cv::noArray(), CV_8UC3);
  return loaders::pictures::encode_jpeg(canvas, 90);
}

// 100 files, each under 100 digests: the work of 10,000 pictures without a gigabyte on the disk.
class PictureFiles {
 public:
  PictureFiles() : folder_(fs::temp_directory_path() / fmt::format("q3d_leakage_bench_{}", ::getpid())) {
    fs::create_directories(folder_);
    for (unsigned i = 0; i < 100; ++i) {
      const std::vector<std::byte> jpeg = picture(i);
      const fs::path path = folder_ / fmt::format("{}.jpg", i);
      std::ofstream(path, std::ios::binary)
          .write(reinterpret_cast<const char*>(jpeg.data()), static_cast<std::streamsize>(jpeg.size()));
      for (unsigned copy = 0; copy < 100; ++copy) {
        files.push_back({path.string(), fmt::format("{:064x}", 100 * i + copy)});
      }
    }
  }
  ~PictureFiles() { fs::remove_all(folder_); }
  PictureFiles(const PictureFiles&) = delete;
  PictureFiles& operator=(const PictureFiles&) = delete;

  fs::path cache() const { return folder_ / "hashes.txt"; }
  std::vector<pipeline::leakage::PictureFile> files;

 private:
  fs::path folder_;
};

// Read, decoded, hashed and written to the cache, on all cores.
void hash_pictures(benchmark::State& state) {
  const PictureFiles made;
  for (auto _ : state) {
    fs::remove(made.cache());
    pipeline::leakage::PictureHashes hashes(made.cache());
    hashes.add(made.files, /*quiet=*/true);
    benchmark::DoNotOptimize(hashes.find(made.files.front().sha256));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(made.files.size()));
  state.counters["peak_MB"] = peak_megabytes();
}
BENCHMARK(hash_pictures)->Unit(benchmark::kMillisecond)->UseRealTime()->Iterations(1);

// Measures a second run, which reads the cache.
void hashes_from_cache(benchmark::State& state) {
  const PictureFiles made;
  pipeline::leakage::PictureHashes(made.cache()).add(made.files, /*quiet=*/true);
  for (auto _ : state) {
    pipeline::leakage::PictureHashes hashes(made.cache());
    hashes.add(made.files, /*quiet=*/true);
    benchmark::DoNotOptimize(hashes.find(made.files.front().sha256));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(made.files.size()));
}
BENCHMARK(hashes_from_cache)->Unit(benchmark::kMillisecond)->UseRealTime();

// Half of the bits are set, as in DCT hashes. One picture in ten is a frame of a clip of ten that differ by
// up to four bits.
std::vector<PictureHash> made_hashes(std::size_t count) {
  std::mt19937_64 engine(1);
  const auto half_set = [&] {
    std::array<int, 64> places{};
    for (int i = 0; i < 64; ++i) places[static_cast<std::size_t>(i)] = i;
    std::shuffle(places.begin(), places.end(), engine);
    std::uint64_t hash = 0;
    for (std::size_t i = 0; i < 32; ++i) hash |= std::uint64_t{1} << places[i];
    return hash;
  };
  std::vector<PictureHash> hashes;
  while (hashes.size() < count) {
    hashes.push_back({half_set(), half_set()});
    if (hashes.size() % 100 != 90) continue;
    const PictureHash first = hashes.back();
    for (int frame = 1; frame < 10; ++frame) {
      PictureHash next = first;
      for (int bit = 0; bit < 4; ++bit) next.upright ^= std::uint64_t{1} << (engine() % 64);
      hashes.push_back(next);
    }
  }
  hashes.resize(count);
  return hashes;
}

std::vector<std::uint64_t> upright(const std::vector<PictureHash>& hashes) {
  std::vector<std::uint64_t> bits;
  for (const PictureHash& hash : hashes) bits.push_back(hash.upright);
  return bits;
}

constexpr int kDistance = 4;  // the config's default

void build_index(benchmark::State& state) {
  const auto bits = upright(made_hashes(static_cast<std::size_t>(state.range(0))));
  for (auto _ : state) {
    const filters::HashIndex index(bits, kDistance);
    benchmark::DoNotOptimize(index.size());
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(build_index)->Arg(1'000'000)->Unit(benchmark::kMillisecond);

// One thread's share of comparing a pool with this many test pictures.
void find_nearest(benchmark::State& state) {
  const auto hashes = made_hashes(static_cast<std::size_t>(state.range(0)));
  const filters::HashIndex index(upright(hashes), kDistance);
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(filters::nearest_likeness(index, hashes[i]));
    i = (i + 7919) % hashes.size();
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(find_nearest)->Arg(10'000)->Arg(1'000'000)->Unit(benchmark::kMicrosecond);

// A pool with itself.
void group_alike(benchmark::State& state) {
  const auto hashes = made_hashes(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state) {
    const auto groups = filters::groups_alike(hashes, kDistance);
    state.counters["groups"] = static_cast<double>(groups.size());
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
  state.counters["peak_MB"] = peak_megabytes();
}
BENCHMARK(group_alike)->Arg(10'000)->Arg(100'000)->Arg(1'000'000)->Unit(benchmark::kMillisecond);

}  // namespace
