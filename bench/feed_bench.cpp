// Samples a second that the training feed prepares: feed_bench [SECONDS [SHARD_OR_FOLDER ...]]
//
// Without shards it makes one: 256 crops of 480 px as JPEG, quality 95, of smooth shapes under grain, about
// as large as photographs' (90 kB). Prints a line for one thread and one for all cores, and one for decoding
// the whole crops without any other work, which bounds a feed that decodes whole pictures.

#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <filesystem>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>
#include <thread>
#include <vector>

#include "loaders/pictures/encode.h"
#include "loaders/pictures/jpeg.h"
#include "loaders/pictures/stored_crop.h"
#include "manifests/shard.h"
#include "pipeline/feed/feed.h"

namespace {

namespace fs = std::filesystem;
using namespace q3d;

cv::Mat picture(unsigned seed) {
  std::mt19937 engine(seed);
  cv::Mat canvas(600, 800, CV_8UC3, cv::Scalar(90, 130, 80));
  for (int i = 0; i < 60; ++i) {
    const auto draw = [&engine](unsigned below) { return static_cast<int>(engine() % below); };
    cv::ellipse(canvas, {draw(800), draw(600)}, {10 + draw(120), 10 + draw(80)}, draw(180), 0, 360,
                cv::Scalar(draw(256), draw(256), draw(256)), cv::FILLED);
  }
  cv::Mat grain(canvas.size(), CV_16SC3);
  cv::RNG generator(seed);
  generator.fill(grain, cv::RNG::NORMAL, 0, 8);
  cv::Mat grainy;
  cv::add(canvas, grain, grainy, cv::noArray(), CV_8UC3);
  return grainy;
}

void write_made_shard(const fs::path& path) {
  std::vector<manifests::ShardSample> samples;
  std::size_t bytes = 0;
  for (unsigned i = 0; i < 256; ++i) {
    manifests::ShardSample& sample = samples.emplace_back();
    sample.record.id = fmt::format("made/{}", i);
    sample.record.box = {200, 150, 380, 300};
    const loaders::pictures::SquareBox box = loaders::pictures::square_box(sample.record.box);
    const loaders::pictures::StoredCrop stored =
        loaders::pictures::make_stored_crop(picture(i), cv::Mat(), box);
    sample.crop = loaders::pictures::encode_jpeg(stored.rgb, 95);
    bytes += sample.crop.size();
    sample.crop_side_px = stored.rgb.rows;
    sample.crop_from_image = stored.from_image;
    sample.patch_box = {box.center_x_px, box.center_y_px, box.side_px};
    sample.judgement.verdict = manifests::Verdict::retained;
  }
  fmt::print("made 256 crops of {} px, {} kB each\n", samples[0].crop_side_px, bytes / 256 / 1000);
  manifests::ShardHeader header;
  header.image_encoding = manifests::ImageEncoding::jpeg;
  manifests::write_shard(path, header, samples);
}

// Returns the CPU time of all threads. It says more than wall time where other programs share the machine.
double cpu_seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

void measure(const std::vector<fs::path>& shards, int threads, double seconds) {
  std::vector<pipeline::feed::ShardPool> pools;
  pools.emplace_back("bench", shards);
  const pipeline::feed::Feed feed(std::move(pools), {1.0}, {.batch = 48, .threads = threads}, 1);
  feed.batch(0);  // the first touches cold files
  const double cpu_start = cpu_seconds();
  const auto start = std::chrono::steady_clock::now();
  double elapsed = 0.0;
  std::int64_t samples = 0;
  while (elapsed < seconds) {
    samples += feed.batch(samples + feed.batch_size()).size;
    elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  const double rate = static_cast<double>(samples) / elapsed;
  const double cpu_rate = static_cast<double>(samples) / (cpu_seconds() - cpu_start);
  fmt::print("{} threads: {:.0f} samples/s, {:.0f} a CPU second\n", threads, rate, cpu_rate);
}

void measure_decoding(const fs::path& shard, double seconds) {
  const pipeline::feed::ShardPool pool("bench", {shard});
  const double start = cpu_seconds();
  double elapsed = 0.0;
  std::int64_t crops = 0;
  while (elapsed < seconds) {
    const std::vector<std::byte> crop = pool.sample(crops % pool.size()).crop;
    if (loaders::pictures::decode_jpeg(crop).rgb.empty()) throw std::runtime_error("a crop is no JPEG");
    ++crops;
    elapsed = cpu_seconds() - start;
  }
  fmt::print("decoding alone: {:.0f} crops a CPU second\n", static_cast<double>(crops) / elapsed);
}

// As the program does (model/device.cpp): glibc would give large blocks back to the system after every
// picture.
void keep_freed_memory() {
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
}

}  // namespace

int main(int argc, char** argv) {
  keep_freed_memory();
  cv::setNumThreads(1);  // as in the program: the feed's threads are the only ones
  const double seconds = argc > 1 ? std::atof(argv[1]) : 5.0;
  std::vector<fs::path> shards(argv + std::min(argc, 2), argv + argc);
  const fs::path made = fs::temp_directory_path() / fmt::format("q3d_feed_bench_{}.h5", ::getpid());
  try {
    if (shards.empty()) {
      write_made_shard(made);
      shards.push_back(made);
    }
    measure(shards, 1, seconds);
    measure_decoding(shards.front(), seconds);
    const int cores = static_cast<int>(std::thread::hardware_concurrency());
    if (cores > 1) measure(shards, cores, seconds);
  } catch (const std::exception& error) {
    fmt::print(stderr, "feed_bench: {}\n", error.what());
    fs::remove(made);
    return 1;
  }
  fs::remove(made);
  return 0;
}
