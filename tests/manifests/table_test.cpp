#include "manifests/table.h"

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <thread>

#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "manifests/table_reader.h"
#include "tests/manifests/full_disk.h"
#include "tests/support/paths.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<std::byte> bytes(std::string_view text) {
  const auto view = std::as_bytes(std::span(text));
  return {view.begin(), view.end()};
}

Table make_table() {
  Table table;
  table.rows = 3;
  table.add<float>("matrix", {2, 2}, std::vector<float>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
  table.add<double>("error", {}, std::vector<double>{0.1, std::numeric_limits<double>::quiet_NaN(), -1e300});
  table.add<std::int8_t>("family", {}, std::vector<std::int8_t>{-1, 0, 4});
  table.add<std::uint8_t>("flag", {}, std::vector<std::uint8_t>{0, 1, 255});
  table.add<std::int32_t>("steps", {}, std::vector<std::int32_t>{-5, 0, 1 << 30});
  table.add<std::int64_t>("count", {1}, std::vector<std::int64_t>{-1, 0, std::int64_t{1} << 60});
  table.text["species"] = {"żubr", "", "brown bear"};
  table.text["nothing"] = {"", "", ""};
  table.blobs["picture"] = {bytes("abc"), {}, bytes(std::string_view("\0\xff", 2))};
  table.blobs["empty"] = {{}, {}, {}};
  for (int i = 0; i < 12; ++i) table.attributes["attribute" + std::to_string(i)] = std::string(i * 100, 'x');
  return table;
}

void expect_equal(const Table& got, const Table& expected) {
  EXPECT_EQ(got.rows, expected.rows);
  EXPECT_EQ(got.text, expected.text);
  EXPECT_EQ(got.blobs, expected.blobs);
  EXPECT_EQ(got.attributes, expected.attributes);
  ASSERT_EQ(got.numeric.size(), expected.numeric.size());
  for (const auto& [name, column] : expected.numeric) {
    ASSERT_TRUE(got.numeric.contains(name)) << name;
    EXPECT_EQ(got.numeric.at(name).type, column.type) << name;
    EXPECT_EQ(got.numeric.at(name).row_shape, column.row_shape) << name;
    EXPECT_EQ(got.numeric.at(name).data, column.data) << name;
  }
}

TEST(Table, ReadsBackWhatWasWritten) {
  const testing::ScratchDir scratch;
  const fs::path path = scratch.path() / "table.h5";
  const std::string digest = write_table(path, make_table());
  EXPECT_EQ(digest, sha256_file(path));
  expect_equal(read_table(path), make_table());
  expect_equal(read_table("a name for messages", read_bytes(path)), make_table());
}

TEST(Table, BytesThatLieElsewhereMakeTheSameFile) {
  const testing::ScratchDir scratch;
  const Table owning = make_table();
  Table viewing = make_table();
  for (const auto& [name, values] : owning.blobs) {
    viewing.blobs.erase(name);
    viewing.blob_views[name] = {values.begin(), values.end()};
  }
  EXPECT_EQ(write_table(scratch.path() / "owning.h5", owning),
            write_table(scratch.path() / "viewing.h5", viewing));
  expect_equal(read_table(scratch.path() / "viewing.h5"), owning);
  viewing.blobs["picture"] = owning.blobs.at("picture");
  EXPECT_THROW(write_table(scratch.path() / "twice.h5", viewing), std::logic_error);
  viewing.blobs.erase("picture");
  viewing.blob_views["picture"].pop_back();
  EXPECT_THROW(write_table(scratch.path() / "short.h5", viewing), std::logic_error);
}

TEST(Table, HoldsNoRowsOrNoColumns) {
  const testing::ScratchDir scratch;
  Table no_rows;
  no_rows.add<float>("matrix", {2, 2}, {});
  no_rows.text["species"] = {};
  no_rows.blobs["picture"] = {};
  write_table(scratch.path() / "no_rows.h5", no_rows);
  expect_equal(read_table(scratch.path() / "no_rows.h5"), no_rows);
  Table no_columns;
  no_columns.rows = 9;
  write_table(scratch.path() / "no_columns.h5", no_columns);
  expect_equal(read_table(scratch.path() / "no_columns.h5"), no_columns);
}

TEST(Table, EqualTablesGiveEqualBytesAtAnyTimeInAnyThread) {
  const testing::ScratchDir scratch;
  const std::string first = write_table(scratch.path() / "a.h5", make_table());
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // HDF5's time stamps count seconds
  std::vector<std::string> digests(4);
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < digests.size(); ++i) {
      threads.emplace_back([&, i] {
        digests[i] = write_table(scratch.path() / ("b" + std::to_string(i) + ".h5"), make_table());
      });
    }
  }
  EXPECT_THAT(digests, ::testing::Each(first));
}

TEST(Table, RefusesMalformedTables) {
  const testing::ScratchDir scratch;
  const fs::path path = scratch.path() / "table.h5";
  Table table = make_table();
  EXPECT_THROW(table.add<float>("new", {2}, std::vector<float>(5)), std::logic_error);
  EXPECT_THROW(table.add<float>("error", {}, std::vector<float>(3)), std::logic_error);
  EXPECT_THROW(static_cast<void>(table.numeric.at("error").as<float>()), std::logic_error);
  EXPECT_THAT([&] { static_cast<void>(table.column<float>("error")); },
              ThrowsMessage<std::runtime_error>(HasSubstr("column error: got float64, expected float32")));
  EXPECT_THROW(static_cast<void>(table.column<float>("absent")), std::runtime_error);

  const auto expect_refused = [&](auto&& change) {
    Table bad = make_table();
    change(bad);
    EXPECT_THROW(write_table(path, bad), std::logic_error);
  };
  expect_refused([](Table& t) { t.rows = 4; });
  expect_refused([](Table& t) { t.text["species"].pop_back(); });
  expect_refused([](Table& t) { t.blobs["picture"].pop_back(); });
  expect_refused([](Table& t) { t.text["error"] = {"", "", ""}; });
  expect_refused([](Table& t) { t.blobs["error"] = {{}, {}, {}}; });
  expect_refused([](Table& t) { t.text["error_offsets"] = {"", "", ""}; });
  expect_refused([](Table& t) { t.text["a/b"] = {"", "", ""}; });
  expect_refused([](Table& t) { t.attributes["rows"] = "3"; });
  expect_refused([](Table& t) { t.attributes["long"] = std::string(70'000, 'x'); });
  expect_refused([](Table& t) { t.numeric["error"].row_shape = {0}; });

  table.text["species"][1] = std::string("a\0b", 3);
  EXPECT_THAT([&] { write_table(path, table); },
              ThrowsMessage<std::runtime_error>(HasSubstr("column species, row 1: the text holds a NUL")));
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(Table, FullDiskNamesThePathAndLeavesNothing) {
  const testing::ScratchDir scratch;
  const fs::path path = scratch.path() / "table.h5";
  Table table = make_table();
  table.blobs["picture"][1].resize(1 << 20);
  {
    const testing::FullDisk full(1 << 16);
    EXPECT_THAT([&] { write_table(path, table); },
                ThrowsMessage<std::runtime_error>(HasSubstr(path.string())));
  }
  EXPECT_TRUE(fs::is_empty(scratch.path()));
  write_table(path, table);  // HDF5 is still in order
  expect_equal(read_table(path), table);
}

class TableReaderTest : public ::testing::Test {
 protected:
  void SetUp() override { write_table(path_, make_table()); }
  testing::ScratchDir scratch_;
  fs::path path_ = scratch_.path() / "table.h5";
};

TEST_F(TableReaderTest, ReadsRowRanges) {
  const TableReader reader(path_);
  EXPECT_EQ(reader.rows(), 3);
  EXPECT_EQ(reader.columns().size(), 10U);
  EXPECT_EQ(reader.columns().at("matrix").row_shape, (std::vector<std::int64_t>{2, 2}));
  EXPECT_THAT(reader.numeric("matrix", 1, 1).as<float>(), ElementsAre(4, 5, 6, 7));
  EXPECT_THAT(reader.numeric("steps", 1, 2).as<std::int32_t>(), ElementsAre(0, 1 << 30));
  EXPECT_THAT(reader.text("species", 0, 2), ElementsAre("żubr", ""));
  EXPECT_THAT(reader.blobs("picture", 2, 1), ElementsAre(bytes(std::string_view("\0\xff", 2))));
  EXPECT_TRUE(reader.numeric("matrix", 3, 0).data.empty());
}

TEST_F(TableReaderTest, RefusesOtherColumnsKindsAndRows) {
  const TableReader reader(path_);
  EXPECT_THAT([&] { reader.numeric("absent", 0, 1); },
              ThrowsMessage<std::runtime_error>(HasSubstr(path_.string() + ": no column absent")));
  EXPECT_THROW(reader.numeric("species", 0, 1), std::runtime_error);
  EXPECT_THROW(reader.text("picture", 0, 1), std::runtime_error);
  EXPECT_THROW(reader.blobs("steps", 0, 1), std::runtime_error);
  EXPECT_THROW(reader.numeric("steps", 2, 2), std::out_of_range);
  EXPECT_THROW(reader.numeric("steps", -1, 1), std::out_of_range);
  EXPECT_THROW(reader.text("species", 0, -1), std::out_of_range);
  EXPECT_THROW(reader.blobs("picture", 1, std::numeric_limits<std::int64_t>::max()), std::out_of_range);
}

TEST_F(TableReaderTest, ServesManyThreads) {
  const TableReader reader(path_);
  std::vector<int> wrong(4);
  {
    std::vector<std::jthread> threads;
    for (auto& count : wrong) {
      threads.emplace_back([&] {
        for (int i = 0; i < 200; ++i) {
          if (reader.text("species", 2, 1)[0] != "brown bear") ++count;
          if (reader.blobs("picture", 0, 1)[0] != bytes("abc")) ++count;
          if (reader.numeric("matrix", 2, 1).as<float>()[3] != 11.0F) ++count;
        }
      });
    }
  }
  EXPECT_THAT(wrong, ::testing::Each(0));
}

}  // namespace
}  // namespace q3d::manifests
