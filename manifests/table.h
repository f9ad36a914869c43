// A table of columns of equal length in one HDF5 file. Shards and the outputs of stages are such tables.
//
// A numeric column is a dataset (rows, ...row_shape). Text is fixed-width UTF-8, padded with NUL. A column of
// variable-length bytes (pictures) is one flat uint8 dataset `<name>` and one dataset `<name>_offsets` of
// rows + 1 int64. All datasets are contiguous, little-endian and unfiltered. The root group has the attribute
// `rows` (int64) and text attributes. Equal tables give equal bytes: times are off, the library-version
// bounds are fixed, and datasets are written in the order of kind and name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace q3d::manifests {

enum class ElementType : std::uint8_t { float32, float64, int8, uint8, int32, int64 };
std::size_t size_of(ElementType type);
std::string_view to_string(ElementType type);  // numpy's name: "float32", ...

template <typename T>
struct element_type;  // specialised for the six types above
// clang-format off
template <> struct element_type<float> { static constexpr ElementType value = ElementType::float32; };
template <> struct element_type<double> { static constexpr ElementType value = ElementType::float64; };
template <> struct element_type<std::int8_t> { static constexpr ElementType value = ElementType::int8; };
template <> struct element_type<std::uint8_t> { static constexpr ElementType value = ElementType::uint8; };
template <> struct element_type<std::int32_t> { static constexpr ElementType value = ElementType::int32; };
template <> struct element_type<std::int64_t> { static constexpr ElementType value = ElementType::int64; };
// clang-format on

struct NumericColumn {
  ElementType type = ElementType::float32;
  std::vector<std::int64_t> row_shape;  // empty: one number in each row
  std::vector<std::byte> data;          // rows * product(row_shape) elements, row-major

  // Returns the data as numbers of type T. Throws std::logic_error if T is not the column's type.
  template <typename T>
  std::span<const T> as() const;
};

// Returns how many numbers one row has: the product of the extents.
std::int64_t elements_per_row(const std::vector<std::int64_t>& row_shape);

struct Table {
  std::int64_t rows = 0;
  std::map<std::string, NumericColumn> numeric;
  std::map<std::string, std::vector<std::string>> text;
  std::map<std::string, std::vector<std::vector<std::byte>>> blobs;
  // Further columns of bytes whose bytes lie elsewhere, for a table that is only written: write_table does
  // not copy them before it composes the file. They must outlive the call. A table that was read has none.
  std::map<std::string, std::vector<std::span<const std::byte>>> blob_views;
  std::map<std::string, std::string> attributes;  // text attributes of the file's root group

  // Adds a column with `values`, which are rows * product(row_shape) numbers. Throws std::logic_error if
  // their count is wrong or the name is already taken.
  template <typename T>
  void add(const std::string& name, std::vector<std::int64_t> row_shape, std::span<const T> values);
  // Returns the values of a column. Throws std::runtime_error that names the column if it is absent or has
  // another type.
  template <typename T>
  std::span<const T> column(const std::string& name) const;
  // The same for a column that must have `per_row` numbers in each row; another count throws too.
  template <typename T>
  std::span<const T> column(const std::string& name, std::size_t per_row) const;
  // Returns the texts of a column. Throws std::runtime_error that names the column if it is absent.
  const std::vector<std::string>& texts(const std::string& name) const;
};

// Writes the table under a temporary name, syncs it and renames it. Returns the file's SHA-256. The file is
// composed in memory first, which takes about the table's size once more during the call. Throws
// std::runtime_error that names the path (disk full, no permission, a NUL inside a text). Throws
// std::logic_error for a malformed table: column lengths that differ from `rows`, names that are not
// [A-Za-z0-9_]+ or end in "_offsets", or an attribute over 60,000 bytes.
std::string write_table(const std::filesystem::path& path, const Table& table);

// Reads the whole table. Throws std::runtime_error that names path and dataset, what was found and what was
// expected.
Table read_table(const std::filesystem::path& path);
// The same for a file whose bytes the caller has read, so that it can digest the very bytes that are parsed.
// `path` names the file in messages.
Table read_table(const std::filesystem::path& path, std::vector<std::byte> bytes);

}  // namespace q3d::manifests
