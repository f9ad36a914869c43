// Composes the HDF5 file in memory and writes it like any other file. HDF5 itself never touches the disk: a
// full disk then fails in one write(2) with its reason, instead of inside the library's cache, which 1.10
// cannot close cleanly afterwards.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/hdf5.h"
#include "manifests/table.h"

namespace q3d::manifests {
namespace {

using hdf5::check;
using hdf5::Handle;

static_assert(std::endian::native == std::endian::little, "shards are little-endian");

constexpr std::size_t kMaxAttributeBytes = 60'000;  // HDF5 keeps attributes below 64 KiB in the object header
constexpr std::size_t kMaxRank = 8;

void check_name(const std::string& name) {
  const bool plain = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  });
  if (name.empty() || !plain || name.ends_with("_offsets")) {
    throw std::logic_error(
        fmt::format("\"{}\" cannot name a column: [A-Za-z0-9_]+ that does not end in _offsets", name));
  }
}

void check_rows(const std::string& name, std::size_t got, std::int64_t expected) {
  if (static_cast<std::int64_t>(got) != expected) {
    throw std::logic_error(fmt::format("column {}: got {} rows, expected {}", name, got, expected));
  }
}

void check_table(const Table& table) {
  for (const auto& [name, column] : table.numeric) {
    check_name(name);
    if (column.row_shape.size() >= kMaxRank || std::any_of(column.row_shape.begin(), column.row_shape.end(),
                                                           [](auto extent) { return extent < 1; })) {
      throw std::logic_error(fmt::format("column {}: extents of a row must be 1 or more, 7 at most", name));
    }
    const auto row_bytes =
        static_cast<std::size_t>(elements_per_row(column.row_shape)) * size_of(column.type);
    if (column.data.size() != static_cast<std::size_t>(table.rows) * row_bytes) {
      throw std::logic_error(fmt::format("column {}: got {} bytes, expected {} rows of {}", name,
                                         column.data.size(), table.rows, row_bytes));
    }
  }
  for (const auto& [name, values] : table.text) {
    check_name(name);
    check_rows(name, values.size(), table.rows);
    if (table.numeric.contains(name)) throw std::logic_error(fmt::format("two columns are named {}", name));
  }
  for (const auto& [name, values] : table.blobs) {
    check_name(name);
    check_rows(name, values.size(), table.rows);
    if (table.numeric.contains(name) || table.text.contains(name)) {
      throw std::logic_error(fmt::format("two columns are named {}", name));
    }
  }
  for (const auto& [name, value] : table.attributes) {
    if (name == "rows" || value.size() > kMaxAttributeBytes || value.find('\0') != std::string::npos) {
      throw std::logic_error(
          fmt::format("attribute {}: the name is taken, or its {} bytes are too many or hold "
                      "a NUL",
                      name, value.size()));
    }
  }
}

hid_t stored_type(ElementType type) {
  switch (type) {
    case ElementType::float32:
      return H5T_IEEE_F32LE;
    case ElementType::float64:
      return H5T_IEEE_F64LE;
    case ElementType::int8:
      return H5T_STD_I8LE;
    case ElementType::uint8:
      return H5T_STD_U8LE;
    case ElementType::int32:
      return H5T_STD_I32LE;
    case ElementType::int64:
      return H5T_STD_I64LE;
  }
  throw std::logic_error("unknown element type");
}

Handle text_type(std::size_t width) {
  Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "text type");
  check(H5Tset_size(type.get(), std::max<std::size_t>(width, 1)), "text width");
  check(H5Tset_strpad(type.get(), H5T_STR_NULLPAD), "text padding");
  check(H5Tset_cset(type.get(), H5T_CSET_UTF8), "text encoding");
  return type;
}

// An HDF5 file in memory.
class Image {
 public:
  explicit Image(std::size_t expected_bytes) {
    const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "file access properties");
    check(H5Pset_fapl_core(access.get(), expected_bytes, false), "in-memory file");
    check(H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_V18), "library version bounds");
    const Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose, "file creation properties");
    check(H5Pset_obj_track_times(creation.get(), false), "no times");
    // HDF5 first looks whether the name exists on disk; no name below /dev/null ever does.
    file_.emplace_back(H5Fcreate("/dev/null/table", H5F_ACC_TRUNC, creation.get(), access.get()), H5Fclose,
                       "in-memory file");
  }

  void attribute(const std::string& name, hid_t type, const void* value) {
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose, name);
    const Handle attribute(
        H5Acreate2(file_[0].get(), name.c_str(), type, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
        name);
    check(H5Awrite(attribute.get(), type, value), name);
  }

  void dataset(const std::string& name, hid_t type, const std::vector<hsize_t>& extents, const void* data) {
    const Handle space(H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr), H5Sclose,
                       name);
    const Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, name);
    check(H5Pset_layout(creation.get(), H5D_CONTIGUOUS), name);
    check(H5Pset_obj_track_times(creation.get(), false), name);
    const Handle dataset(
        H5Dcreate2(file_[0].get(), name.c_str(), type, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
        H5Dclose, name);
    check(H5Dwrite(dataset.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data), name);
  }

  std::vector<std::byte> bytes() const {
    check(H5Fflush(file_[0].get(), H5F_SCOPE_GLOBAL), "flush");
    const ssize_t size = check(H5Fget_file_image(file_[0].get(), nullptr, 0), "file image");
    std::vector<std::byte> image(static_cast<std::size_t>(size));
    check(H5Fget_file_image(file_[0].get(), image.data(), image.size()), "file image");
    return image;
  }

 private:
  std::vector<Handle> file_;  // one
};

void write_attributes(Image& image, const Table& table) {
  image.attribute("rows", H5T_STD_I64LE, &table.rows);
  for (const auto& [name, value] : table.attributes) {
    const Handle type = text_type(value.size());
    image.attribute(name, type.get(), value.c_str());
  }
}

void write_text(Image& image, const std::string& name, const std::vector<std::string>& values) {
  std::size_t width = 1;
  for (std::size_t row = 0; row < values.size(); ++row) {
    width = std::max(width, values[row].size());
    if (values[row].find('\0') != std::string::npos) {
      throw std::runtime_error(fmt::format("column {}, row {}: the text holds a NUL", name, row));
    }
  }
  std::string padded(values.size() * width, '\0');
  for (std::size_t row = 0; row < values.size(); ++row) values[row].copy(&padded[row * width], width);
  const Handle type = text_type(width);
  image.dataset(name, type.get(), {values.size()}, padded.data());
}

void write_blobs(Image& image, const std::string& name, const std::vector<std::vector<std::byte>>& values) {
  std::vector<std::int64_t> offsets{0};
  std::vector<std::byte> flat;
  for (const auto& value : values) {
    flat.insert(flat.end(), value.begin(), value.end());
    offsets.push_back(static_cast<std::int64_t>(flat.size()));
  }
  image.dataset(name, H5T_STD_U8LE, {flat.size()}, flat.data());
  image.dataset(name + "_offsets", H5T_STD_I64LE, {offsets.size()}, offsets.data());
}

std::size_t payload_bytes(const Table& table) {
  std::size_t total = 1 << 16;
  for (const auto& [name, column] : table.numeric) total += column.data.size();
  for (const auto& [name, values] : table.blobs) {
    for (const auto& value : values) total += value.size() + sizeof(std::int64_t);
  }
  return total;
}

std::vector<std::byte> compose(const Table& table) {
  const hdf5::Session session;
  Image image(payload_bytes(table));
  write_attributes(image, table);
  for (const auto& [name, column] : table.numeric) {
    std::vector<hsize_t> extents{static_cast<hsize_t>(table.rows)};
    extents.insert(extents.end(), column.row_shape.begin(), column.row_shape.end());
    image.dataset(name, stored_type(column.type), extents, column.data.data());
  }
  for (const auto& [name, values] : table.text) write_text(image, name, values);
  for (const auto& [name, values] : table.blobs) write_blobs(image, name, values);
  return image.bytes();
}

}  // namespace

std::string write_table(const std::filesystem::path& path, const Table& table) {
  check_table(table);
  std::vector<std::byte> image;
  try {
    image = compose(table);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("cannot write {}: {}", path.string(), error.what()));
  }
  write_file_atomically(path, image);
  return sha256(image);
}

}  // namespace q3d::manifests
