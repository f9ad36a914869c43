#include "manifests/shard.h"

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <thread>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/shard_columns.h"
#include "tests/manifests/full_disk.h"
#include "tests/manifests/shard_fixture.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

void expect_equal(const SampleRecord& got, const SampleRecord& expected) {
  EXPECT_EQ(got.id, expected.id);
  EXPECT_EQ(got.dataset, expected.dataset);
  EXPECT_EQ(got.split, expected.split);
  EXPECT_EQ(got.source, expected.source);
  EXPECT_EQ(got.species, expected.species);
  EXPECT_EQ(got.family, expected.family);
  EXPECT_EQ(got.image_ref, expected.image_ref);
  EXPECT_EQ(got.width_px, expected.width_px);
  EXPECT_EQ(got.height_px, expected.height_px);
  EXPECT_EQ(std::memcmp(&got.box, &expected.box, sizeof(Box)), 0);
  EXPECT_EQ(std::memcmp(&got.keypoints, &expected.keypoints, sizeof(Keypoints)), 0);
  ASSERT_EQ(got.truth.has_value(), expected.truth.has_value());
  if (!got.truth) return;
  EXPECT_EQ(got.truth->has_pose, expected.truth->has_pose);
  EXPECT_EQ(got.truth->has_betas, expected.truth->has_betas);
  EXPECT_EQ(got.truth->has_keypoints_3d, expected.truth->has_keypoints_3d);
  EXPECT_EQ(got.truth->pose_axis_angle, expected.truth->pose_axis_angle);
  EXPECT_EQ(got.truth->betas, expected.truth->betas);
  EXPECT_EQ(got.truth->trans, expected.truth->trans);
  EXPECT_EQ(got.truth->keypoints_3d, expected.truth->keypoints_3d);
}

void expect_equal(const ShardSample& got, const ShardSample& expected) {
  expect_equal(got.record, expected.record);
  EXPECT_EQ(got.image_sha256, expected.image_sha256);
  EXPECT_EQ(got.label_kind, expected.label_kind);
  EXPECT_EQ(got.judgement.verdict, expected.judgement.verdict);
  EXPECT_EQ(got.judgement.reason, expected.judgement.reason);
  EXPECT_EQ(got.judgement.detail, expected.judgement.detail);
  EXPECT_EQ(got.judgement.initial_error, expected.judgement.initial_error);
  EXPECT_EQ(got.judgement.final_error, expected.judgement.final_error);
  EXPECT_EQ(std::isnan(got.judgement.gain), std::isnan(expected.judgement.gain));
  if (!std::isnan(got.judgement.gain)) {
    EXPECT_EQ(got.judgement.gain, expected.judgement.gain);
  }
  EXPECT_EQ(got.judgement.iterations, expected.judgement.iterations);
  EXPECT_EQ(got.judgement.best_iteration, expected.judgement.best_iteration);
  for (const TrustColumn& column : kTrustColumns) {
    const double score = expected.judgement.trust.*column.score;
    EXPECT_EQ(std::isnan(got.judgement.trust.*column.score), std::isnan(score)) << column.name;
    if (!std::isnan(score)) {
      EXPECT_EQ(got.judgement.trust.*column.score, score) << column.name;
    }
  }
  EXPECT_EQ(got.image_width_px, expected.image_width_px);
  EXPECT_EQ(got.image_height_px, expected.image_height_px);
  EXPECT_EQ(got.crop, expected.crop);
  EXPECT_EQ(got.crop_mask, expected.crop_mask);
  EXPECT_EQ(got.crop_side_px, expected.crop_side_px);
  EXPECT_EQ(got.crop_from_image, expected.crop_from_image);
  EXPECT_EQ(got.patch_box, expected.patch_box);
  EXPECT_EQ(got.has_pose, expected.has_pose);
  EXPECT_EQ(got.has_betas, expected.has_betas);
  EXPECT_EQ(got.has_keypoints_3d, expected.has_keypoints_3d);
  EXPECT_EQ(got.body.pose, expected.body.pose);
  EXPECT_EQ(got.body.betas, expected.body.betas);
  EXPECT_EQ(got.body.camera, expected.body.camera);
  EXPECT_EQ(got.body.translation, expected.body.translation);
  EXPECT_EQ(got.keypoints_3d, expected.keypoints_3d);
  EXPECT_EQ(got.projected_2d, expected.projected_2d);
}

class ShardTest : public ::testing::Test {
 protected:
  std::string write() {
    return write_shard(path_, testing::make_shard_header(), testing::make_shard_samples());
  }
  // Reads a good shard as a table, lets `change` break it and writes it back.
  template <typename Change>
  void expect_refused(Change change, const std::string& why) {
    if (good_.numeric.empty()) {
      write();
      good_ = read_table(path_);
    }
    Table table = good_;
    change(table);
    write_table(path_, table);
    EXPECT_THAT([&] { read_shard(path_); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(path_.string()), HasSubstr(why))));
  }
  testing::ScratchDir scratch_;
  fs::path path_ = scratch_.path() / "shard.h5";
  Table good_;
};

TEST_F(ShardTest, ReadsBackEverythingButAbsolutePaths) {
  const std::string digest = write();
  EXPECT_EQ(digest, sha256_file(path_));
  const Shard shard = read_shard(path_);
  EXPECT_EQ(shard.header.schema, 2);
  EXPECT_EQ(shard.header.dataset, "quadruped3d");
  EXPECT_EQ(shard.header.version, "0123456789ab");
  EXPECT_EQ(shard.header.unit, 42);
  EXPECT_EQ(shard.header.image_encoding, ImageEncoding::png);
  EXPECT_EQ(shard.header.datasets, testing::make_shard_header().datasets);
  const auto expected = testing::make_shard_samples();
  ASSERT_EQ(shard.samples.size(), expected.size());
  for (std::size_t row = 0; row < expected.size(); ++row) {
    SCOPED_TRACE(row);
    expect_equal(shard.samples[row], expected[row]);
    EXPECT_EQ(shard.samples[row].record.image_path, "");
    EXPECT_EQ(shard.samples[row].record.mask_path, "");
  }
  EXPECT_EQ(read_file(path_).find("/absolute"), std::string::npos);
}

TEST_F(ShardTest, EqualInputGivesEqualBytesLater) {
  const std::string first = write();
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  EXPECT_EQ(write(), first);
  auto samples = testing::make_shard_samples();
  samples[2].judgement.gain = 0.51;
  EXPECT_NE(write_shard(path_, testing::make_shard_header(), samples), first);
}

TEST_F(ShardTest, HoldsNoSamples) {
  write_shard(path_, testing::make_shard_header(), {});
  EXPECT_TRUE(read_shard(path_).samples.empty());
}

TEST_F(ShardTest, ReadsRowRanges) {
  write();
  const ShardReader reader(path_);
  EXPECT_EQ(reader.rows(), 3);
  const auto rows = reader.samples(1, 2);
  ASSERT_EQ(rows.size(), 2U);
  expect_equal(rows[0], testing::make_shard_sample(1));
  expect_equal(rows[1], testing::make_shard_sample(2));
  EXPECT_TRUE(reader.samples(3, 0).empty());
  EXPECT_THROW(reader.samples(2, 2), std::out_of_range);
  EXPECT_THROW(reader.samples(-1, 1), std::out_of_range);
}

TEST_F(ShardTest, ReferenceShardsHoldNoPictures) {
  auto header = testing::make_shard_header();
  header.image_encoding = ImageEncoding::reference;
  auto samples = testing::make_shard_samples();
  EXPECT_THROW(write_shard(path_, header, samples), std::invalid_argument);
  for (auto& sample : samples) {
    sample.crop.clear();
    sample.crop_mask.clear();
  }
  write_shard(path_, header, samples);
  EXPECT_EQ(read_shard(path_).header.image_encoding, ImageEncoding::reference);
  EXPECT_THROW(write_shard(path_, testing::make_shard_header(), samples), std::invalid_argument);
}

TEST_F(ShardTest, RefusesFailedRecordsAndUnknownHeaders) {
  auto samples = testing::make_shard_samples();
  samples[1].record.failure = Reason::image_missing;
  EXPECT_THAT([&] { write_shard(path_, testing::make_shard_header(), samples); },
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr(samples[1].record.id), HasSubstr("image_missing"))));
  auto header = testing::make_shard_header();
  header.schema = kShardSchema + 1;
  EXPECT_THROW(write_shard(path_, header, {}), std::invalid_argument);
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(ShardTest, ChecksMagicThenSchemaThenCompleteness) {
  write_file_atomically(path_, "not a shard");
  EXPECT_THAT([&] { read_shard(path_); }, ThrowsMessage<std::runtime_error>(HasSubstr("not an HDF5 file")));
  const auto later_schema_and_foreign = [](Table& t) {
    t.attributes["format"] = "other";
    t.attributes["schema"] = "3";
    t.numeric.clear();
  };
  expect_refused(later_schema_and_foreign, "attribute format is \"other\"");
  const auto later_schema = [](Table& t) {
    t.attributes["schema"] = "3";
    t.numeric.clear();
  };
  expect_refused(later_schema, "shard schema 3, but this program reads schemas 1 to 2");
  expect_refused([](Table& t) { t.attributes["schema"] = "01"; }, "shard schema 01");
  expect_refused([](Table& t) { t.attributes.erase("format"); }, "attribute format is absent");
  expect_refused([](Table& t) { t.attributes.erase("schema"); }, "shard schema absent");
}

TEST_F(ShardTest, RefusesEachColumnThatIsAbsent) {
  for (const ShardColumn& column : shard_columns()) {
    expect_refused(
        [&](Table& t) {
          t.numeric.erase(column.name), t.text.erase(column.name), t.blobs.erase(column.name);
        },
        "column " + column.name + " is absent");
  }
}

TEST_F(ShardTest, RefusesWhatItsSchemaDoesNotKnow) {
  expect_refused([](Table& t) { t.text["extra"] = {"", "", ""}; }, "column extra is not in schema 2");
  expect_refused([](Table& t) { t.attributes["schema"] = "1"; }, "column trust is not in schema 1");
  expect_refused([](Table& t) { t.attributes["keypoint_names"] = "[\"nose\"]"; },
                 "attribute keypoint_names is [\"nose\"], expected [\"left_eye\"");
  expect_refused([](Table& t) { t.attributes["datasets"] = "{\"a/b\": {}}"; }, "attribute datasets");
  expect_refused(
      [](Table& t) {
        t.numeric["pose"].row_shape = {35, 9};
      },
      "column pose is of another type or shape, expected float32 (rows, 35, 3, 3)");
  expect_refused([](Table& t) { t.text["verdict"][2] = "kept"; },
                 "column verdict, row 2: unknown verdict \"kept\"");
  expect_refused([](Table& t) { t.numeric["family"].data[1] = std::byte{5}; }, "column family, row 1: got 5");
  expect_refused([](Table& t) { t.numeric["has_pose"].data[0] = std::byte{2}; },
                 "column has_pose, row 0: got 2");
  expect_refused([](Table& t) { t.attributes["unit"] = "4x"; }, "attribute unit is \"4x\"");
  expect_refused([](Table& t) { t.attributes["image_encoding"] = "webp"; }, "image_encoding is \"webp\"");
  expect_refused([](Table& t) { t.attributes.erase("version"); }, "attribute version is absent");
}

TEST_F(ShardTest, FullDiskNamesThePathAndKeepsTheOldShard) {
  const std::string before = write();
  auto samples = testing::make_shard_samples();
  samples[0].crop.resize(1 << 20);
  {
    const testing::FullDisk full(1 << 18);
    EXPECT_THAT([&] { write_shard(path_, testing::make_shard_header(), samples); },
                ThrowsMessage<std::runtime_error>(HasSubstr(path_.string())));
  }
  EXPECT_EQ(sha256_file(path_), before);
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch_.path()), fs::directory_iterator()), 1);
}

// The document's tables and the code cannot drift apart.
TEST(ShardFormatDocument, HasOneRowForEachColumn) {
  const std::string document = read_file(fs::path(Q3D_SOURCE_DIR) / "docs" / "shard-format.md");
  std::size_t last = 0;
  for (const ShardColumn& column : shard_columns()) {
    const std::string row = "| `" + column.name + "` | " + dtype_of(column) + " | " + shape_of(column) +
                            " | " + (column.units.empty() ? "-" : column.units) + " | " + column.meaning +
                            " |\n";
    const std::size_t at = document.find(row);
    EXPECT_NE(at, std::string::npos) << "docs/shard-format.md lacks the row\n" << row;
    EXPECT_GE(at, last) << column.name << " is out of order";
    last = at == std::string::npos ? last : at;
  }
}

}  // namespace
}  // namespace q3d::manifests
