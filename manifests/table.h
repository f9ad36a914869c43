// A table of equal-length columns in one HDF5 file: the container of shards and of stage outputs.
//
// Numeric columns are datasets (rows, ...row_shape); text is fixed-width UTF-8, padded with NUL;
// variable-length bytes (pictures) are one flat uint8 dataset `<name>` and one `<name>_offsets` of rows + 1
// int64. All datasets are contiguous, little-endian and unfiltered. The root group carries `rows` (int64) and
// text attributes. Equal tables give equal bytes: times are off, the library-version bounds are fixed,
// and datasets are written by kind and name.
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
  std::vector<std::int64_t> row_shape;  // empty: one number a row
  std::vector<std::byte> data;          // rows * product(row_shape) elements, row-major

  // View as T; throws std::logic_error when T is not the column's type.
  template <typename T>
  std::span<const T> as() const;
};

// Numbers in one row: the product of the extents.
std::int64_t elements_per_row(const std::vector<std::int64_t>& row_shape);

struct Table {
  std::int64_t rows = 0;
  std::map<std::string, NumericColumn> numeric;
  std::map<std::string, std::vector<std::string>> text;
  std::map<std::string, std::vector<std::vector<std::byte>>> blobs;
  std::map<std::string, std::string> attributes;  // text attributes of the file's root group

  // Appends `values` (rows * product(row_shape) of them) as a column; throws std::logic_error on a wrong
  // count or a name already taken.
  template <typename T>
  void add(const std::string& name, std::vector<std::int64_t> row_shape, std::span<const T> values);
  // The column's values; throws std::runtime_error naming the column when it is absent or of another type.
  template <typename T>
  std::span<const T> column(const std::string& name) const;
};

// Writes the table under a temporary name, syncs it and renames it. Returns the file's SHA-256. The file is
// composed in memory first: about twice the table's size for the time of the call.
// Throws std::runtime_error naming the path (disk full, no permission, a NUL inside a text) and
// std::logic_error for a malformed table (column lengths that differ from `rows`, names that are not
// [A-Za-z0-9_]+ or end in "_offsets", an attribute over 60,000 bytes).
std::string write_table(const std::filesystem::path& path, const Table& table);

// Reads the whole table. Throws std::runtime_error naming path, dataset, got and expected.
Table read_table(const std::filesystem::path& path);

}  // namespace q3d::manifests
