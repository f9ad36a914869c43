// Planted copies of pictures through the whole comparison, without a network.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "manifests/atomic_file.h"
#include "manifests/csv.h"
#include "manifests/digest.h"
#include "pipeline/leakage/leakage_run.h"
#include "pipeline/leakage/picture_hashes.h"
#include "tests/support/paths.h"

namespace q3d::pipeline::leakage {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// Soft shapes: structure at all scales, as photographs have.
cv::Mat drawn(unsigned seed) {
  std::mt19937 engine(seed);
  const auto below = [&](int limit) { return static_cast<int>(engine() % static_cast<unsigned>(limit)); };
  cv::Mat picture(240, 320, CV_8UC3, cv::Scalar(below(256), below(256), below(256)));
  for (int i = 0; i < 40; ++i) {
    cv::ellipse(picture, {below(320), below(240)}, {10 + below(80), 10 + below(60)}, below(180), 0, 360,
                cv::Scalar(below(256), below(256), below(256)), cv::FILLED);
  }
  return picture;
}

cv::Mat resized(const cv::Mat& picture, double scale) {
  cv::Mat other;
  cv::resize(picture, other, {}, scale, scale, cv::INTER_AREA);
  return other;
}

cv::Mat flipped(const cv::Mat& picture) {
  cv::Mat other;
  cv::flip(picture, other, 1);
  return other;
}

class Leakage : public ::testing::Test {
 protected:
  fs::path root() const { return scratch_.path() / "data"; }

  void save(const std::string& name, const cv::Mat& picture, int quality = 95) {
    std::vector<std::uint8_t> bytes;
    cv::imencode(fs::path(name).extension().string(), picture, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
    fs::create_directories((root() / name).parent_path());
    std::ofstream(root() / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }

  // Every picture of a folder of `root` as a record of `<folder>.json`, those of `twice` two times.
  void annotate(const std::string& folder, const std::string& twice = "") {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(root() / folder))
      names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    json records = json::array();
    for (const std::string& name : names) {
      json keypoints = json::array();
      for (int k = 0; k < 26; ++k) keypoints.push_back({20 + k, 30 + k, 1});
      const json record = {
          {"img_path", folder + "/" + name}, {"bbox", {10, 10, 50, 60}}, {"keypoint_2d", keypoints}};
      records.push_back(record);
      if (name == twice) records.push_back(record);
    }
    std::ofstream(root() / (folder + ".json")) << json{{"data", records}};
  }

  json set(const std::string& folder) const {
    return {{"name", folder},
            {"format", "prima"},
            {"root", root().string()},
            {"annotations", folder + ".json"},
            {"orientation", orientation_},
            {"role", "2d_only"}};
  }

  LeakageRunSummary run(const std::string& out, int threads) const {
    const json config = {{"datasets", {set("pool")}}, {"leakage", {{"test_sets", {set("test")}}}}};
    run::RunOptions options;
    options.out = scratch_.path() / out;
    options.threads = threads;
    options.quiet = true;
    return run_leakage(config::parse_build_config(config, "t"), options);
  }

  std::string text(const std::string& file) const { return manifests::read_file(scratch_.path() / file); }

  std::vector<std::vector<std::string>> rows(const std::string& file) const {
    const std::string csv = text(file);
    manifests::CsvReader reader(csv, file);
    std::vector<std::vector<std::string>> all;
    for (std::vector<std::string> cells; reader.next(cells);) all.push_back(cells);
    return all;
  }

  // Pool and test sets with every kind of copy; pictures 10 and 11 of the pool are the mirror image of each
  // other, and 9 is there twice. The rest has nothing to do with anything.
  void plant() {
    for (unsigned i = 0; i < 11; ++i) save("pool/p" + std::to_string(i) + ".png", drawn(i));
    save("pool/p11.jpg", resized(flipped(drawn(10)), 0.8), 60);
    save("pool/n02114367_52_777.png", drawn(50));
    fs::copy_file(root() / "pool/p9.png", root() / "pool/q9.png");
    fs::create_directories(root() / "test");
    fs::copy_file(root() / "pool/p0.png", root() / "test/same.png");
    save("test/small.png", resized(drawn(1), 0.4));
    save("test/squeezed.jpg", drawn(2), 30);
    save("test/mirror.png", flipped(drawn(3)));
    save("test/all.jpg", resized(flipped(drawn(4)), 0.6), 50);
    save("test/N02114367_52.JPEG", drawn(51));
    for (unsigned i = 60; i < 70; ++i) save("test/own" + std::to_string(i) + ".png", drawn(i));
    annotate("pool", "p1.png");
    annotate("test");
  }

  q3d::testing::ScratchDir scratch_;
  std::string orientation_ = "stored";
};

TEST_F(Leakage, planted_copies_are_found_and_nothing_else) {
  plant();
  const LeakageRunSummary summary = run("out", 2);
  std::map<std::string, std::vector<std::string>> leaks;
  for (const auto& row : rows("out/leaks.csv")) leaks[row[0]] = {row.begin() + 1, row.end()};
  const auto leak = [&](const std::string& id) { return leaks.at("pool/train/pool/" + id); };
  EXPECT_THAT(leak("p0.png#1"), ElementsAre(HasSubstr("/same.png#"), "same file", "SHA-256", "2d_only"));
  EXPECT_THAT(leak("p1.png#2"),
              ElementsAre(HasSubstr("/small.png#"), "looks alike", Not(HasSubstr("mirrored")), "2d_only"));
  EXPECT_THAT(leak("p1.png#3"),
              ElementsAre(HasSubstr("/small.png#"), "looks alike", HasSubstr("of 64"), "2d_only"));
  EXPECT_THAT(leak("p2.png#6"),
              ElementsAre(HasSubstr("/squeezed.jpg#"), "looks alike", HasSubstr("of 64"), "2d_only"));
  EXPECT_THAT(leak("p3.png#7"),
              ElementsAre(HasSubstr("/mirror.png#"), "looks alike", HasSubstr("mirrored"), "2d_only"));
  EXPECT_THAT(leak("p4.png#8"),
              ElementsAre(HasSubstr("/all.jpg#"), "looks alike", HasSubstr("mirrored"), "2d_only"));
  EXPECT_THAT(leak("n02114367_52_777.png#0"), ElementsAre(HasSubstr("/N02114367_52.JPEG#"), "same origin",
                                                          "imagenet n02114367_52", "2d_only"));
  EXPECT_EQ(leaks.size(), 8U) << "seven samples and the header";
  EXPECT_THAT(rows("out/duplicates.csv"),
              ElementsAre(ElementsAre("group", "id"), ElementsAre("0", "pool/train/pool/p10.png#4"),
                          ElementsAre("0", "pool/train/pool/p11.jpg#5"),
                          ElementsAre("1", "pool/train/pool/p9.png#13"),
                          ElementsAre("1", "pool/train/pool/q9.png#14")));
  EXPECT_EQ(summary.pool_pictures, 13U);
  EXPECT_EQ(summary.test_pictures, 16U);
  EXPECT_EQ(summary.candidates, 15U);
  EXPECT_EQ(summary.pictures_in_groups, 4U);
  const json document = json::parse(text("out/leakage.json"));
  EXPECT_EQ(document["leaks"].size(), 7U);
  EXPECT_EQ(document["groups"], json::parse(R"([["pool/train/pool/p10.png#4", "pool/train/pool/p11.jpg#5"],
                                                       ["pool/train/pool/p9.png#13", "pool/train/pool/q9.png#14"]])"));
  EXPECT_EQ(document["leaks_by_evidence"], (json{{"same file", 1}, {"same origin", 1}, {"looks alike", 5}}));
}

// A phone's picture, stored on its side with an EXIF orientation, and an upright copy of it in the test set.
TEST_F(Leakage, a_picture_that_its_dataset_turns_is_compared_as_turned) {
  cv::Mat stored;
  cv::rotate(drawn(20), stored, cv::ROTATE_90_COUNTERCLOCKWISE);
  save("pool/phone.jpg", stored);
  std::string jpeg = manifests::read_file(root() / "pool/phone.jpg");
  const char exif[] =
      "\xff\xe1\0\x22"
      "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
  jpeg.insert(2, exif, sizeof(exif) - 1);
  std::ofstream(root() / "pool/phone.jpg", std::ios::binary) << jpeg;
  save("test/upright.png", drawn(20));
  annotate("pool");
  annotate("test");
  run("stored", 1);
  EXPECT_EQ(rows("stored/leaks.csv").size(), 1U)
      << "only the header: lying on its side it is another picture";
  orientation_ = "exif";
  run("turned", 1);
  ASSERT_EQ(rows("turned/leaks.csv").size(), 2U);
  EXPECT_THAT(rows("turned/leaks.csv")[1],
              ElementsAre("pool/train/pool/phone.jpg#0", HasSubstr("/upright.png#"), "looks alike",
                          HasSubstr("of 64"), "2d_only"));
  // The hashes of both are remembered in one file.
  fs::copy(scratch_.path() / "stored/picture_hashes.txt", scratch_.path() / "turned/picture_hashes.txt",
           fs::copy_options::overwrite_existing);
  run("turned", 1);
  EXPECT_EQ(rows("turned/leaks.csv").size(), 2U);
}

TEST_F(Leakage, the_page_shows_each_pair_once_and_escapes_names) {
  plant();
  save("pool/a&b<i>.png", drawn(5));
  annotate("pool", "p1.png");
  run("out", 2);
  const std::string page = text("out/leakage.html");
  std::size_t pictures = 0;
  for (std::size_t at = page.find("<img "); at != std::string::npos; at = page.find("<img ", at + 1))
    ++pictures;
  // Six leaking pictures with their test pictures, and three groups of two: a copy of p5 has come.
  EXPECT_EQ(pictures, 6U * 2U + 3U * 2U);
  EXPECT_THAT(page, AllOf(HasSubstr("a&amp;b&lt;i&gt;.png"), Not(HasSubstr("<i>"))));
  // A JPEG in base64 begins with /9j/ (bytes ff d8 ff).
  EXPECT_THAT(page, HasSubstr("data:image/jpeg;base64,/9j/"));
}

TEST_F(Leakage, threads_and_cache_do_not_change_a_byte) {
  plant();
  run("one", 1);
  run("four", 4);
  for (const char* file : {"leaks.csv", "duplicates.csv", "leakage.json", "leakage.html"}) {
    EXPECT_EQ(text(std::string("one/") + file), text(std::string("four/") + file)) << file;
  }
  const std::string before = text("one/leakage.json");
  std::ofstream(scratch_.path() / "one/picture_hashes.txt", std::ios::app) << "dct1 rubbish that was cut";
  run("one", 2);
  EXPECT_EQ(text("one/leakage.json"), before);
}

TEST_F(Leakage, a_test_picture_that_cannot_be_read_is_told) {
  plant();
  fs::remove(root() / "test/own60.png");
  EXPECT_THAT(run("out", 1).notes,
              ::testing::Contains(HasSubstr("cannot be read, so that copies of it are not seen: 1")));
}

TEST_F(Leakage, hashes_are_made_once_for_a_content) {
  save("a.png", drawn(1));
  const fs::path cache = scratch_.path() / "hashes.txt";
  std::ofstream(root() / "text.png") << "no picture";
  const std::string sha = manifests::sha256_file(root() / "a.png");
  const std::string other = manifests::sha256_file(root() / "text.png");
  PictureHashes first(cache);
  first.add({{(root() / "a.png").string(), sha}, {(root() / "text.png").string(), other}}, true);
  ASSERT_TRUE(first.find(sha));
  EXPECT_FALSE(first.find(other)) << "it cannot be decoded";
  fs::remove(root() / "a.png");
  PictureHashes second(cache);
  second.add({{(root() / "a.png").string(), sha}}, true);
  EXPECT_EQ(second.find(sha), first.find(sha)) << "from the cache: the file is gone";
  // A byte of the line changed: it no longer counts, and the picture cannot be hashed again.
  std::string lines = manifests::read_file(cache);
  lines[70] = lines[70] == '0' ? '1' : '0';
  std::ofstream(cache) << lines;
  PictureHashes third(cache);
  EXPECT_FALSE(third.find(sha));
  EXPECT_THROW(third.add({{(root() / "a.png").string(), sha}}, true), std::runtime_error)
      << "a picture that was there a moment ago and is gone says nothing of its content";
}

TEST_F(Leakage, APictureThatIsNotTheDigestedOneIsNotHashedUnderItsDigest) {
  save("a.png", drawn(1));
  PictureHashes hashes(scratch_.path() / "hashes.txt");
  const std::string sha(64, 'a');
  EXPECT_THROW(hashes.add({{(root() / "a.png").string(), sha}}, true), std::runtime_error);
  EXPECT_FALSE(hashes.find(sha));
}

}  // namespace
}  // namespace q3d::pipeline::leakage
