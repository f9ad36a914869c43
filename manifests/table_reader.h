// Reads parts of a table. Training does this batch by batch, from many shards.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/table.h"
#include "manifests/table_content.h"

namespace q3d::manifests {

// Reads only the text attributes, which must be known before the columns are read (format, schema). Throws
// std::runtime_error that names the path if it is not a readable HDF5 file.
std::map<std::string, std::string> read_table_attributes(const std::filesystem::path& path);

// The constructor uses HDF5 to find out where each column lies. The rows are then read from the content
// directly. Reads therefore take no lock, may run in many threads, and survive a fork.
class TableReader {
 public:
  enum class Kind : std::uint8_t { numeric, text, blob };
  struct Column {
    Kind kind = Kind::numeric;
    ElementType type = ElementType::uint8;  // of numeric columns
    std::vector<std::int64_t> row_shape;    // of numeric columns
    std::int64_t row_bytes = 0;             // bytes of a number row, width of a text; 0 for blobs
    std::uint64_t file_offset = 0;
    std::vector<std::int64_t> blob_offsets;  // of blobs: rows + 1 offsets, ascending from 0
  };

  // Opens the file and checks its whole layout: signature, types, extents, offsets, and that every column
  // lies inside the file. Throws std::runtime_error that names path and dataset, what was found and what was
  // expected.
  explicit TableReader(const std::filesystem::path& path);
  explicit TableReader(TableContent content);

  const std::filesystem::path& path() const { return content_.path(); }
  std::int64_t rows() const { return rows_; }
  const std::map<std::string, std::string>& attributes() const { return attributes_; }
  const std::map<std::string, Column>& columns() const { return columns_; }

  // These return the rows [first, first + count) of a column. They throw std::runtime_error that names path
  // and column if it is absent or of another kind, and std::out_of_range for rows that the table lacks.
  NumericColumn numeric(const std::string& name, std::int64_t first, std::int64_t count) const;
  std::vector<std::string> text(const std::string& name, std::int64_t first, std::int64_t count) const;
  std::vector<std::vector<std::byte>> blobs(const std::string& name, std::int64_t first,
                                            std::int64_t count) const;

 private:
  const Column& find(const std::string& name, Kind kind, std::int64_t first, std::int64_t count) const;

  TableContent content_;
  std::int64_t rows_ = 0;
  std::map<std::string, std::string> attributes_;
  std::map<std::string, Column> columns_;
};

}  // namespace q3d::manifests
