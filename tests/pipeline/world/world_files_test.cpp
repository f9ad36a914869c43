// One small world, rendered once and read back: by its files' own rules, by the loaders and by the truth.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "loaders/formats/dataset.h"
#include "manifests/atomic_file.h"
#include "pipeline/world/world.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::world {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kShare = 0.02;
constexpr int kPixels = 128;

WorldOptions options_for(const fs::path& out, int threads) {
  WorldOptions options;
  options.out = out;
  options.seed = 7;
  options.picture_px = kPixels;
  options.share = kShare;
  options.threads = threads;
  return options;
}

json read_json(const fs::path& path) {
  return json::parse(manifests::read_file(path));
}

class WorldFiles : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new fs::path(fs::temp_directory_path() / ("q3d_world_files_" + std::to_string(::getpid())));
    fs::remove_all(*folder_);
    summary_ = new WorldSummary(make_world(options_for(out(), 2)));
  }
  static void TearDownTestSuite() {
    fs::remove_all(*folder_);
    delete folder_;
    delete summary_;
  }
  static fs::path out() { return *folder_ / "world"; }

  static fs::path* folder_;
  static WorldSummary* summary_;
};
fs::path* WorldFiles::folder_ = nullptr;
WorldSummary* WorldFiles::summary_ = nullptr;

std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && entry.path().filename() != ".lock") {
      files[fs::relative(entry.path(), folder).string()] = manifests::read_file(entry.path());
    }
  }
  return files;
}

TEST_F(WorldFiles, TheNumberOfThreadsChangesNoByte) {
  make_world(options_for(*folder_ / "one_thread", 1));
  const auto two = contents(out()), one = contents(*folder_ / "one_thread");
  ASSERT_EQ(one.size(), two.size());
  for (const auto& [name, bytes] : two) {
    ASSERT_TRUE(one.contains(name)) << name;
    EXPECT_TRUE(one.at(name) == bytes) << name << " differs";
  }
}

TEST_F(WorldFiles, AnotherSeedGivesOtherPictures) {
  WorldOptions other = options_for(*folder_ / "other_seed", 2);
  other.seed = 8;
  other.share = 0.002;
  const auto first = make_world(other);
  EXPECT_LT(first.total, summary_->total);
  const json a = read_json(out() / "animal3d/train.json"), b = read_json(other.out / "animal3d/train.json");
  EXPECT_NE(a["data"][0]["pose"], b["data"][0]["pose"]);
}

TEST_F(WorldFiles, AFinishedWorldIsKeptAndOtherFoldersAreLeftAlone) {
  const auto before = fs::last_write_time(out() / "world.json");
  const fs::path mark = out() / ".unfinished-world";  // of a run that was killed after its last file
  EXPECT_FALSE(fs::exists(mark));
  manifests::write_file_atomically(mark, "");
  EXPECT_TRUE(make_world(options_for(out(), 1)).reused);
  EXPECT_EQ(fs::last_write_time(out() / "world.json"), before);
  EXPECT_FALSE(fs::exists(mark));

  WorldOptions elsewhere = options_for(out(), 1);
  elsewhere.asset = *folder_ / "models" / "body.safetensors";
  EXPECT_TRUE(make_world(elsewhere).reused);
  EXPECT_TRUE(manifests::read_file(elsewhere.asset) == manifests::read_file(summary_->asset));

  WorldOptions changed = options_for(out(), 1);
  changed.seed = 9;
  EXPECT_THROW(make_world(changed), std::runtime_error);

  const fs::path foreign = *folder_ / "foreign";
  fs::create_directories(foreign / "animal3d");
  EXPECT_THROW(make_world(options_for(foreign, 1)), std::runtime_error);
  EXPECT_TRUE(fs::exists(foreign / "animal3d"));
}

TEST_F(WorldFiles, AKilledRunIsMadeAnewAndWholly) {
  WorldOptions options = options_for(*folder_ / "killed", 2);
  options.share = 0.004;
  options.progress = [](int, int) { throw std::runtime_error("stopped"); };
  EXPECT_THROW(make_world(options), std::runtime_error);
  EXPECT_FALSE(fs::exists(options.out / "world.json"));
  manifests::write_file_atomically(options.out / "animal3d" / "stale.jpg", "left over");

  options.progress = nullptr;
  EXPECT_FALSE(make_world(options).reused);
  EXPECT_FALSE(fs::exists(options.out / "animal3d" / "stale.jpg"));
  WorldOptions undisturbed = options_for(*folder_ / "undisturbed", 2);
  undisturbed.share = 0.004;
  make_world(undisturbed);
  EXPECT_TRUE(contents(options.out) == contents(undisturbed.out));
}

TEST_F(WorldFiles, RefusesOptionsOutOfRange) {
  for (const auto& change : std::vector<std::function<void(WorldOptions&)>>{
           [](WorldOptions& o) { o.share = 0.0; }, [](WorldOptions& o) { o.share = std::nan(""); },
           [](WorldOptions& o) { o.picture_px = 8; }, [](WorldOptions& o) { o.threads = -1; },
           [](WorldOptions& o) { o.out.clear(); }}) {
    WorldOptions options = options_for(*folder_ / "refused", 1);
    change(options);
    EXPECT_THROW(make_world(options), std::invalid_argument);
  }
}

// The projection of the official code, by hand: the crop is the square of the box's longer side about its
// floored centre, scaled to 256 px; focal 1000 px.
std::pair<double, double> projected(const json& point, const json& trans, const json& bbox) {
  const double x = point[0].get<double>() + trans[0].get<double>();
  const double y = point[1].get<double>() + trans[1].get<double>();
  const double z = point[2].get<double>() + trans[2].get<double>();
  const double centre_x = std::floor((2.0 * bbox[0].get<double>() + bbox[2].get<double>()) / 2.0);
  const double centre_y = std::floor((2.0 * bbox[1].get<double>() + bbox[3].get<double>()) / 2.0);
  const double px_per_crop_px = std::max(bbox[2].get<double>(), bbox[3].get<double>()) / 256.0;
  return {centre_x + px_per_crop_px * 1000.0 * x / z, centre_y + px_per_crop_px * 1000.0 * y / z};
}

TEST_F(WorldFiles, TruthProjectsBackOntoTheAnnotation) {
  for (const std::string folder : {"animal3d", "control_animal3dlatest"}) {
    const bool exact = folder != "animal3d";
    double noise = 0.0;
    int labelled = 0;
    const json file = read_json(out() / folder / "train.json");
    for (const json& record : file["data"]) {
      for (std::size_t k = 0; k < 26; ++k) {
        const auto [x, y] = projected(record["keypoint_3d"][k], record["trans"], record["bbox"]);
        EXPECT_NEAR(record["reproj_kp_2d"][k][0].get<double>(), x, 0.05);
        EXPECT_NEAR(record["reproj_kp_2d"][k][1].get<double>(), y, 0.05);
        if (record["keypoint_2d"][k][2] == 0.0) continue;
        const double off = std::hypot(record["keypoint_2d"][k][0].get<double>() - x,
                                      record["keypoint_2d"][k][1].get<double>() - y);
        if (exact) {
          EXPECT_LT(off, 0.5) << record["img_path"] << " keypoint " << k;
        }
        noise += off;
        ++labelled;
      }
    }
    ASSERT_GT(labelled, 0);
    if (!exact) {
      EXPECT_GT(noise / labelled, 0.2) << "people do not label this exactly";
    }
  }
}

TEST_F(WorldFiles, HiddenTruthProjectsBackThroughItsOwnCamera) {
  for (const std::string file :
       {"superanimal_quadruped_train", "superanimal_quadruped_test", "animal_kingdom_test"}) {
    const json truth = read_json(out() / "truth" / (file + ".json"))["pictures"];
    ASSERT_FALSE(truth.empty());
    for (const auto& [name, record] : truth.items()) {
      for (std::size_t k = 0; k < 26; ++k) {
        const auto [x, y] = projected(record["keypoint_3d"][k], record["trans"], record["bbox"]);
        EXPECT_NEAR(record["keypoint_2d"][k][0].get<double>(), x, 0.05) << name;
        EXPECT_NEAR(record["keypoint_2d"][k][1].get<double>(), y, 0.05) << name;
      }
      EXPECT_EQ(record["pose"].size(), 105U);
      EXPECT_EQ(record["betas"].size(), 41U);
      EXPECT_TRUE(fs::exists(out() / record["mask_path"].get<std::string>())) << name;
    }
  }
}

TEST_F(WorldFiles, MasksShowTheAnimalInsideItsPicture) {
  const auto look = [&](const fs::path& image_path, const fs::path& mask_path, const json& bbox) {
    const cv::Mat image = cv::imread(image_path.string(), cv::IMREAD_COLOR);
    const cv::Mat mask = cv::imread(mask_path.string(), cv::IMREAD_UNCHANGED);
    ASSERT_FALSE(image.empty()) << image_path;
    ASSERT_EQ(mask.type(), CV_8UC1) << mask_path;
    ASSERT_EQ(mask.size(), image.size());
    const cv::Rect box(bbox[0], bbox[1], bbox[2], bbox[3]);
    const int area = cv::countNonZero(mask);
    EXPECT_GT(area, 0.05 * box.area()) << mask_path;
    EXPECT_EQ(cv::countNonZero(mask == 255), area);
    EXPECT_GT(cv::countNonZero(mask(box & cv::Rect({0, 0}, mask.size()))), 0.9 * area) << mask_path;
  };
  for (const std::string folder : {"animal3d", "control_animal3dlatest"}) {
    const json file = read_json(out() / folder / "test.json");
    ASSERT_EQ(file["data"].size(), 10U);
    for (const json& record : file["data"]) {
      const fs::path root = out() / folder;
      look(root / record["img_path"].get<std::string>(), root / record["mask_path"].get<std::string>(),
           record["bbox"]);
      EXPECT_EQ(cv::imread((root / record["img_path"].get<std::string>()).string()).cols, record["width"]);
    }
  }
  const json truth = read_json(out() / "truth/superanimal_quadruped_test.json");
  ASSERT_EQ(truth["pictures"].size(), 12U);
  for (const auto& [name, record] : truth["pictures"].items()) {
    const std::string base = name.substr(name.rfind('/') + 1);
    look(out() / "superanimal_quadruped/images" / base, out() / record["mask_path"].get<std::string>(),
         record["bbox"]);
  }
}

TEST_F(WorldFiles, SuperAnimalHasItsQuirks) {
  const json file = read_json(out() / "superanimal_quadruped/annotations/train.json");
  ASSERT_EQ(file["categories"].size(), 1U);
  EXPECT_EQ(file["categories"][0]["keypoints"].size(), 39U);
  EXPECT_EQ(file["images"].size(), file["annotations"].size());
  bool zeros = false, minus_ones = false;
  for (const json& annotation : file["annotations"]) {
    ASSERT_EQ(annotation["keypoints"].size(), 117U);
    EXPECT_EQ(annotation["num_keypoints"], 39);
    EXPECT_EQ(annotation["category_id"], 1);
    for (std::size_t k = 0; k < 39; ++k) {
      const double x = annotation["keypoints"][3 * k], v = annotation["keypoints"][3 * k + 2];
      zeros = zeros || (v == 0.0 && x == 0.0);
      minus_ones = minus_ones || (v == -1.0 && x == -1.0);
      EXPECT_TRUE(v == -1.0 || v == 0.0 || v == 1.0 || v == 2.0);
      EXPECT_TRUE(v <= 0.0 || x >= 0.0);
    }
    for (const std::size_t antler : {8U, 9U, 13U, 14U})
      EXPECT_EQ(annotation["keypoints"][3 * antler + 2], -1);
  }
  EXPECT_TRUE(zeros && minus_ones) << "both codes of a missing point occur";
}

TEST_F(WorldFiles, AnimalKingdomBoxesAreTight) {
  const json records = read_json(out() / "animal_kingdom/annotation/ak_P3_mammal/test.json");
  ASSERT_EQ(records.size(), 10U);
  for (const json& record : records) {
    ASSERT_EQ(record["joints"].size(), 23U);
    double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
    for (std::size_t k = 0; k < 23; ++k) {
      const double x = record["joints"][k][0], y = record["joints"][k][1];
      if (record["joints_vis"][k] == 0) {
        EXPECT_EQ(x, -1.0);
        continue;
      }
      left = std::min(left, x), right = std::max(right, x), top = std::min(top, y),
      bottom = std::max(bottom, y);
    }
    if (right <= left && bottom <= top) continue;
    EXPECT_NEAR(record["scale"].get<double>() * 200.0, std::max(right - left, bottom - top), 1e-6);
    EXPECT_NEAR(record["center"][0].get<double>(), 0.5 * (left + right), 1e-6);
  }
}

TEST_F(WorldFiles, LoadersReadEveryRecord) {
  const std::vector<loaders::formats::DatasetOptions> sets{
      {"a", "prima", "train", out() / "animal3d", "train.json", {}},
      {"c", "prima", "test", out() / "control_animal3dlatest", "test.json", {}},
      {"s", "superanimal", "train", out() / "superanimal_quadruped", "annotations/train.json", "images"},
      {"k", "animal_kingdom", "test", out() / "animal_kingdom", "annotation/ak_P3_mammal/test.json",
       "dataset"}};
  const std::vector<std::string> names{"animal3d/train", "control_animal3dlatest/test",
                                       "superanimal_quadruped/train", "animal_kingdom/test"};
  for (std::size_t i = 0; i < sets.size(); ++i) {
    const loaders::formats::Dataset dataset = loaders::formats::load_dataset(sets[i]);
    EXPECT_EQ(static_cast<int>(dataset.records.size()), summary_->pictures.at(names[i]));
    for (const manifests::SampleRecord& record : dataset.records) {
      EXPECT_EQ(record.failure, manifests::Reason::none) << record.id << ": " << record.failure_detail;
      EXPECT_TRUE(fs::exists(record.image_path)) << record.id;
      EXPECT_EQ(record.truth.has_value(), i < 2) << record.id;
    }
  }
}

TEST_F(WorldFiles, ShareScalesTheCounts) {
  EXPECT_EQ(summary_->pictures.at("superanimal_quadruped/train"), 28);  // 0.02 of 1,400
  EXPECT_EQ(summary_->pictures.at("superanimal_quadruped/test"), 12);
  EXPECT_EQ(summary_->pictures.at("animal_kingdom/test"), 10);
  EXPECT_TRUE(fs::exists(summary_->asset));
}

}  // namespace
}  // namespace q3d::pipeline::world
