// Files that a careless or malicious hand made: each must be refused with a clear message, and none may make
// the reader allocate more than the file's size.
#include <gmock/gmock.h>
#include <hdf5.h>

#include <fstream>
#include <functional>
#include <limits>
#include <random>

#include "manifests/atomic_file.h"
#include "manifests/file_descriptor.h"
#include "manifests/table.h"
#include "manifests/table_reader.h"
#include "tests/support/paths.h"

// HDF5 1.10 leaks memory of its own when it refuses a damaged file. Handles that we left open would show in
// TearDown all the same.
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libhdf5";
}

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class HostileTable : public ::testing::Test {
 protected:
  void TearDown() override {
    EXPECT_EQ(H5Fget_obj_count(static_cast<hid_t>(H5F_OBJ_ALL), H5F_OBJ_ALL), 0) << "handles left open";
  }
  void write_good() {
    Table table;
    table.rows = 2;
    table.add<float>("score", {3}, std::vector<float>{1, 2, 3, 4, 5, 6});
    table.text["name"] = {"a", "bc"};
    table.blobs["picture"] = {std::vector<std::byte>(5), std::vector<std::byte>(7)};
    table.attributes["format"] = "test";
    write_table(path_, table);
  }
  // Opens the good table with the HDF5 library and lets `change` break it.
  void break_with(const std::function<void(hid_t)>& change) {
    write_good();
    const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(file, 0);
    change(file);
    ASSERT_GE(H5Fclose(file), 0);
  }
  void expect_refused(const std::string& why) {
    EXPECT_THAT([&] { read_table(path_); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(path_.string()), HasSubstr(why))));
    EXPECT_THAT([&] { read_table(path_, read_bytes(path_)); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr(path_.string()), HasSubstr(why))))
        << "from memory";
  }
  static void add_rows(hid_t file, std::int64_t rows) {
    const hid_t space = H5Screate(H5S_SCALAR);
    const hid_t attribute = H5Acreate2(file, "rows", H5T_STD_I64LE, space, H5P_DEFAULT, H5P_DEFAULT);
    ASSERT_GE(H5Awrite(attribute, H5T_STD_I64LE, &rows), 0);
    H5Aclose(attribute);
    H5Sclose(space);
  }
  static void add(hid_t file, const char* name, hid_t type, std::vector<hsize_t> extents,
                  hid_t creation = H5P_DEFAULT, const void* data = nullptr) {
    const hid_t space = H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr);
    const hid_t set = H5Dcreate2(file, name, type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
    ASSERT_GE(set, 0) << name;
    if (data != nullptr) {
      ASSERT_GE(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data), 0);
    }
    H5Dclose(set);
    H5Sclose(space);
  }
  testing::ScratchDir scratch_;
  fs::path path_ = scratch_.path() / "table.h5";
};

TEST_F(HostileTable, WrongMagic) {
  for (const std::string content : {"", "x", "version https://git-lfs.github.com/spec/v1\n", "\x89HDF"}) {
    write_file_atomically(path_, content);
    expect_refused("not an HDF5 file");
  }
  fs::remove(path_);
  expect_refused("No such file or directory");
}

TEST_F(HostileTable, TruncatedAtAnyLength) {
  write_good();
  const auto size = fs::file_size(path_);
  for (std::uintmax_t length = 0; length < size; length += 61) {
    write_good();
    fs::resize_file(path_, length);
    EXPECT_THROW(read_table(path_), std::runtime_error) << length;
  }
}

TEST_F(HostileTable, PlainHdf5FileWithoutRows) {
  const hid_t file = H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(file);
  expect_refused("rows: the attribute is absent");
}

TEST_F(HostileTable, AbsurdExtents) {
  // Late allocation lets a file claim extents that it does not hold.
  break_with([&](hid_t file) { add(file, "huge", H5T_IEEE_F64LE, {hsize_t{1} << 58}); });
  expect_refused("huge: ");
  break_with([&](hid_t file) { add(file, "huge", H5T_STD_U8LE, {1 << 20, 1 << 20, 1 << 20}); });
  expect_refused("huge: ");
}

TEST_F(HostileTable, ARowThatOverflowsInATableWithoutRows) {
  const hid_t file = H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  add_rows(file, 0);
  add(file, "wide_row", H5T_STD_U8LE, {0, hsize_t{1} << 40, hsize_t{1} << 40});
  H5Fclose(file);
  expect_refused("wide_row: an extent of 1099511627776 overflows");
}

TEST_F(HostileTable, AbsurdRows) {
  for (const std::int64_t rows : {std::int64_t{-1}, std::numeric_limits<std::int64_t>::max()}) {
    break_with([&](hid_t file) {
      H5Adelete(file, "rows");
      add_rows(file, rows);
    });
    expect_refused(rows < 0 ? "rows: got -1" : "expected 9223372036854775807");
  }
}

TEST_F(HostileTable, AbsurdTextWidth) {
  break_with([&](hid_t file) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, std::size_t{1} << 30);
    add(file, "wide", type, {2});
    H5Tclose(type);
  });
  expect_refused("wide: entries of 1073741824 bytes");
}

TEST_F(HostileTable, RowsThatDisagree) {
  const std::vector<float> data(3);
  break_with([&](hid_t file) { add(file, "other", H5T_IEEE_F32LE, {3}, H5P_DEFAULT, data.data()); });
  expect_refused("other: got 3 rows, expected 2");
}

TEST_F(HostileTable, OffsetsThatDoNotAscendOrDoNotFit) {
  const std::vector<std::vector<std::int64_t>> bad{
      {0, 9, 7}, {0, -5, 12}, {0, 13, 12}, {1, 5, 12}, {0, 5, 13}};
  for (const auto& offsets : bad) {
    break_with([&](hid_t file) {
      const hid_t set = H5Dopen2(file, "picture_offsets", H5P_DEFAULT);
      H5Dwrite(set, H5T_STD_I64LE, H5S_ALL, H5S_ALL, H5P_DEFAULT, offsets.data());
      H5Dclose(set);
    });
    expect_refused("picture_offsets: must ascend from 0 to 12");
  }
}

TEST_F(HostileTable, OffsetsOfAnotherLengthTypeOrWithoutBytes) {
  const std::vector<std::int64_t> zeros(8);
  break_with([&](hid_t file) {
    H5Ldelete(file, "picture_offsets", H5P_DEFAULT);
    add(file, "picture_offsets", H5T_STD_I64LE, {4}, H5P_DEFAULT, zeros.data());
  });
  expect_refused("picture_offsets: expected 2 rows + 1 of int64");
  break_with([&](hid_t file) { H5Ldelete(file, "picture", H5P_DEFAULT); });
  expect_refused("picture_offsets: its bytes, dataset picture, are absent");
}

TEST_F(HostileTable, LinksGroupsAndOtherStorage) {
  break_with(
      [](hid_t file) { H5Lcreate_external("/etc/passwd", "/", file, "link", H5P_DEFAULT, H5P_DEFAULT); });
  expect_refused("link: is a link to elsewhere");
  break_with([](hid_t file) { H5Lcreate_soft("/score", file, "link", H5P_DEFAULT, H5P_DEFAULT); });
  expect_refused("link: is a link to elsewhere");
  break_with([](hid_t file) { H5Gclose(H5Gcreate2(file, "group", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT)); });
  expect_refused("group: is no dataset");
  break_with([&](hid_t file) {
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_external(creation, "/etc/passwd", 0, 8);
    add(file, "outside", H5T_STD_U8LE, {2}, creation);
    H5Pclose(creation);
  });
  expect_refused("outside: is not stored contiguously in this file");
  break_with([&](hid_t file) {
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    const hsize_t chunk = 1;
    H5Pset_chunk(creation, 1, &chunk);
    add(file, "chunked", H5T_STD_U8LE, {2}, creation);
    H5Pclose(creation);
  });
  expect_refused("chunked: is not stored contiguously in this file");
}

TEST_F(HostileTable, OtherTypes) {
  const std::vector<std::uint8_t> zeros(64);
  break_with([&](hid_t file) { add(file, "big_endian", H5T_IEEE_F32BE, {2}, H5P_DEFAULT, zeros.data()); });
  expect_refused("big_endian: is neither");
  break_with([&](hid_t file) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, H5T_VARIABLE);
    add(file, "variable", type, {2});
    H5Tclose(type);
  });
  expect_refused("variable: is neither");
}

// Flips that hit numbers or texts cannot be seen here (digests see them); every other one must throw, and
// none may crash or exhaust memory.
TEST_F(HostileTable, RandomFlipsNeverCrash) {
  write_good();
  const std::string good = read_file(path_);
  std::mt19937 random(20240607);
  int refused = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    std::string bad = good;
    for (int flips = 0; flips < 1 + trial % 3; ++flips) {
      bad[random() % bad.size()] ^= static_cast<char>(1 << (random() % 8));
    }
    std::ofstream(path_, std::ios::binary | std::ios::in) << bad;  // same size: written in place
    try {
      const Table table = read_table(path_);
      EXPECT_EQ(table.rows, 2);
    } catch (const std::runtime_error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace q3d::manifests
