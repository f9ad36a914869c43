// Damage in mass: one bit of a file that a training reads again is flipped, or the file is cut, again and
// again. The training must name the file, or end with the weights of an undamaged run.
//
// Q3D_DAMAGES says how often (default 60), Q3D_SEED chooses other places. `make torture` takes 1,100.
#include <gmock/gmock.h>

#include <array>
#include <cstdio>
#include <map>
#include <random>

#include "tests/pipeline/training/training_run_fixture.h"
#include "tests/support/damage.h"

namespace q3d::pipeline::training {
namespace {

namespace fs = std::filesystem;

constexpr int kCutsOneIn = 11;     // the others are flipped bits
constexpr int kMostFailures = 10;  // more of them say nothing new

class TrainingRot : public TrainingRun {
 protected:
  TrainingRot() {
    train_on_dataset({4, 5});
    run("half", 1);
    weights_ = manifests::read_file(run("straight").model);
  }

  // A training that was stopped after its first step, and its pool, with one damaged file.
  void damage_one(const fs::path& file, std::mt19937_64& random) {
    fs::remove_all(path("out"));
    fs::copy(path("half"), path("out"), fs::copy_options::recursive);
    const bool cuts = random() % kCutsOneIn == 0;
    const testing::Damaged damaged = testing::damage_file(path(file), cuts, random);
    const std::string what = file.string() + ", " + damaged.text;
    Count& count = counts_[file];
    ++(cuts ? count.cuts : count.flips);
    try {
      EXPECT_TRUE(manifests::read_file(run("out").model) == weights_) << what << ": other weights";
    } catch (const std::exception& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr(path(file).string())) << what;
      ++count.refused;
    }
    manifests::write_file_atomically(path(file), damaged.before);
  }

  struct Count {
    int flips = 0, cuts = 0, refused = 0;
  };
  std::string weights_;
  std::map<fs::path, Count> counts_;
};

TEST_F(TrainingRot, EveryDamageIsNamedOrHarmless) {
  const std::array<fs::path, 4> all = {"out/state.safetensors", "set/dataset.json", "set/shards/000000.h5",
                                       "set/shards/000001.h5"};
  const auto damages = static_cast<int>(testing::number_from_environment("Q3D_DAMAGES", 60));
  std::mt19937_64 random(static_cast<std::uint64_t>(testing::number_from_environment("Q3D_SEED", 1)));
  const ::testing::TestResult& result = *::testing::UnitTest::GetInstance()->current_test_info()->result();
  for (int number = 0; number < damages && result.total_part_count() < kMostFailures; ++number) {
    damage_one(all.at(static_cast<std::size_t>(number) % all.size()), random);
  }
  for (const auto& [file, count] : counts_) {
    std::printf("%-24s %5d flips, %4d cuts, refused %5d\n", file.c_str(), count.flips, count.cuts,
                count.refused);
    if (file.extension() == ".h5") {
      EXPECT_EQ(count.refused, count.flips + count.cuts) << file;
    }
  }
}

}  // namespace
}  // namespace q3d::pipeline::training
