// Composes the HDF5 file in anonymous memory and then writes it like any other file. A full disk thus fails
// in our own write(2), with its reason, and never inside the library's cache, which HDF5 1.10 cannot close
// cleanly afterwards; and the digest needs no second pass over the disk.
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/hdf5_memory_file.h"
#include "manifests/table.h"

namespace q3d::manifests {
namespace {

using hdf5::check;
using hdf5::Handle;

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
  for (const auto& [name, values] : table.blob_views) {
    check_name(name);
    check_rows(name, values.size(), table.rows);
    if (table.numeric.contains(name) || table.text.contains(name) || table.blobs.contains(name)) {
      throw std::logic_error(fmt::format("two columns are named {}", name));
    }
  }
  for (const auto& [name, value] : table.attributes) {
    if (name == "rows") throw std::logic_error("the attribute name rows is taken");
    if (value.size() > kMaxAttributeBytes || value.find('\0') != std::string::npos) {
      throw std::logic_error(
          fmt::format("attribute {}: {} bytes are too many, or it holds a NUL", name, value.size()));
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

void write_attributes(hdf5::MemoryFile& file, const Table& table) {
  file.attribute("rows", H5T_STD_I64LE, &table.rows);
  for (const auto& [name, value] : table.attributes) {
    const Handle type = text_type(value.size());
    file.attribute(name, type.get(), value.c_str());
  }
}

void write_text(hdf5::MemoryFile& file, const std::string& name, const std::vector<std::string>& values) {
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
  file.dataset(name, type.get(), {values.size()}, padded.data());
}

void write_blobs(hdf5::MemoryFile& file, const std::string& name,
                 const std::vector<std::span<const std::byte>>& values) {
  std::vector<std::int64_t> offsets{0};
  for (const auto& value : values)
    offsets.push_back(offsets.back() + static_cast<std::int64_t>(value.size()));
  file.bytes(name, values);
  file.dataset(name + "_offsets", H5T_STD_I64LE, {offsets.size()}, offsets.data());
}

hdf5::FileImage compose(const Table& table) {
  const hdf5::Session session;
  hdf5::MemoryFile file;
  write_attributes(file, table);
  for (const auto& [name, column] : table.numeric) {
    std::vector<hsize_t> extents{static_cast<hsize_t>(table.rows)};
    extents.insert(extents.end(), column.row_shape.begin(), column.row_shape.end());
    file.dataset(name, stored_type(column.type), extents, column.data.data());
  }
  for (const auto& [name, values] : table.text) write_text(file, name, values);
  auto all_blobs = table.blob_views;
  for (const auto& [name, values] : table.blobs) all_blobs[name] = {values.begin(), values.end()};
  for (const auto& [name, values] : all_blobs) write_blobs(file, name, values);
  return file.finish();
}

hdf5::FileImage composed_for(const std::filesystem::path& path, const Table& table) {
  try {
    return compose(table);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("cannot write {}: {}", path.string(), error.what()));
  }
}

}  // namespace

std::string write_table(const std::filesystem::path& path, const Table& table) {
  check_table(table);
  const hdf5::FileImage image = composed_for(path, table);
  write_file_atomically(path, image.bytes());
  return sha256(image.bytes());
}

}  // namespace q3d::manifests
