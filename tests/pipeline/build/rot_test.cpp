// Damage in mass: one bit of one file of a finished output folder is flipped, or the file is cut, again and
// again. `verify` must find it, and a build or a repair must end with the bytes of an undamaged run.
//
// Q3D_DAMAGES says how often (default 60), Q3D_SEED chooses other places. `make torture` takes 11,000.
#include <chrono>
#include <cstdio>
#include <set>

#include "manifests/durability.h"
#include "pipeline/build/repair.h"
#include "pipeline/dataset/verify.h"
#include "tests/pipeline/build/rebuild_fixture.h"
#include "tests/support/damage.h"

namespace q3d::pipeline::build {
namespace {

constexpr int kCutsOneIn = 11;  // the others are flipped bits
constexpr int kOtherQuality = 80;
constexpr int kMostFailures = 10;  // more of them say nothing new

// The kind under which a file is counted. The tables of a stage are one kind.
std::string kind_of(const fs::path& file) {
  const std::string first = *file.begin();
  const std::string name = file.filename();
  if (first != "stages") return file.extension() == ".h5" ? "published shards" : name;
  const std::string folder = *std::next(file.begin());
  if (folder == "builds") return file.extension() == ".json" ? "plans" : "stamps";
  const std::string stage = folder.substr(0, folder.find('-'));
  return stage + (file.extension() == ".h5" ? " tables" : " " + name);
}

class Rot : public Rebuild {
 protected:
  Rot() {
    manifests::set_durability({.syncs = false, .locks = true});
    make_inputs_old();
    expected_[kOtherQuality] = files(run("other", kOtherQuality).folder);
    version_ = run("out").folder.filename();
    expected_[95] = files(out_ / version_);
    fs::copy(out_, scratch_.path() / "sound", fs::copy_options::recursive | fs::copy_options::copy_symlinks);
    for (const auto& entry : fs::recursive_directory_iterator(out_)) {
      if (!entry.is_regular_file() || entry.file_size() == 0 || entry.path().filename() == ".lock") continue;
      const fs::path file = entry.path().lexically_relative(out_);
      by_kind_[kind_of(file)].push_back(file);
    }
  }
  ~Rot() override { manifests::set_durability({}); }

  // So that digests.txt holds the digests of the pictures: those of files that are younger are not kept.
  void make_inputs_old() {
    for (const auto& entry : fs::recursive_directory_iterator(scratch_.path() / "data")) {
      fs::last_write_time(entry.path(), fs::file_time_type::clock::now() - std::chrono::hours(1));
    }
  }

  // The output folder as the build left it, with its shards under two names.
  void restore() {
    fs::remove_all(out_);
    fs::copy(scratch_.path() / "sound", out_, fs::copy_options::recursive | fs::copy_options::copy_symlinks);
    const fs::path stage_folder = stage("out", "shards");
    for (const auto& entry : fs::directory_iterator(out_ / version_ / "shards")) {
      const fs::path in_stage = stage_folder / ("unit-" + entry.path().filename().string());
      fs::remove(in_stage);
      fs::create_hard_link(entry.path(), in_stage);
    }
  }

  // Damage may stay unseen where nothing wrong can follow: in a cache and a record that nobody believes when
  // their checksums are wrong; at the end of a journal, where a kill leaves a torn line as well; and by a cut
  // of a journal, which then is that of a run that was stopped earlier. Its last units are made again.
  static bool may_stay_unseen(const fs::path& file, const testing::Damaged& damaged, bool cuts) {
    if (file.filename() == "digests.txt" || file.extension() == ".stamps") return true;
    const std::size_t last_line = damaged.before.rfind('\n', damaged.before.size() - 2) + 1;
    const bool is_at_end = damaged.at + 1 >= last_line;  // a damaged line feed joins the last two lines
    return file.filename() == "journal.jsonl" && (cuts || is_at_end);
  }

  bool is_found() {
    try {
      return !dataset::verify(out_ / version_, true, true).problems.empty();
    } catch (const std::runtime_error&) {
      return true;  // no readable dataset.json
    }
  }

  // After the damage comes the same build, another one, which reads the stages' tables, or a repair.
  void expect_mended(int way, const std::string& what) {
    if (way == 2) {
      run::RunOptions options;
      options.quiet = true;
      EXPECT_EQ(repair(out_ / version_, config(), options).unrepaired, std::vector<std::string>{}) << what;
    }
    const int quality = way == 1 ? kOtherQuality : 95;
    const fs::path folder = way == 2 ? out_ / version_ : run("out", quality).folder;
    EXPECT_TRUE(files(folder) == expected_[quality]) << what << ": other files than without the damage";
  }

  void damage_one(int number, std::mt19937_64& random) {
    auto kind = by_kind_.begin();
    std::advance(kind, number % static_cast<int>(by_kind_.size()));
    const fs::path file = kind->second[random() % kind->second.size()];
    restore();
    const bool cuts = random() % kCutsOneIn == 0;
    const testing::Damaged damaged = testing::damage_file(out_ / file, cuts, random);
    const auto way = static_cast<int>(random() % 3);
    const std::string what = file.string() + ", " + damaged.text + ", way " + std::to_string(way);
    const bool found = is_found();
    EXPECT_TRUE(found || may_stay_unseen(file, damaged, cuts)) << what << ": verify did not find it";
    try {
      expect_mended(way, what);
    } catch (const std::exception& error) {
      ADD_FAILURE() << what << ": " << error.what();
    }
    Count& count = counts_[kind->first];
    ++(cuts ? count.cuts : count.flips);
    count.found += found;
  }

  struct Count {
    int flips = 0, cuts = 0, found = 0;
  };

  fs::path out_ = scratch_.path() / "out";
  std::string version_;
  std::map<int, std::map<std::string, std::string>> expected_;  // files of the version, by JPEG quality
  std::map<std::string, std::vector<fs::path>> by_kind_;
  std::map<std::string, Count> counts_;
};

TEST_F(Rot, EveryDamageIsFoundOrMended) {
  const auto damages = static_cast<int>(testing::number_from_environment("Q3D_DAMAGES", 60));
  std::mt19937_64 random(static_cast<std::uint64_t>(testing::number_from_environment("Q3D_SEED", 1)));
  const ::testing::TestResult& result = *::testing::UnitTest::GetInstance()->current_test_info()->result();
  for (int number = 0; number < damages && result.total_part_count() < kMostFailures; ++number) {
    damage_one(number, random);
  }
  for (const auto& [kind, count] : counts_) {
    std::printf("%-24s %5d flips, %4d cuts, verify found %5d\n", kind.c_str(), count.flips, count.cuts,
                count.found);
  }
  EXPECT_GE(by_kind_.size(), 15U) << "a kind of file is not there";
}

}  // namespace
}  // namespace q3d::pipeline::build
