// Reading parts of a table: what training does, batch by batch, from many shards.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/file_descriptor.h"
#include "manifests/table.h"

namespace q3d::manifests {

// The text attributes alone: what must be known before the columns are looked at (format, schema). Throws
// std::runtime_error naming the path when it is not a readable HDF5 file.
std::map<std::string, std::string> read_table_attributes(const std::filesystem::path& path);

// HDF5 is used only to find out where each column lies, in the constructor. The rows themselves are then read
// from the file directly, so reads take no lock, may run in many threads, and survive a fork.
class TableReader {
 public:
  enum class Kind : std::uint8_t { numeric, text, blob };
  struct Column {
    Kind kind = Kind::numeric;
    ElementType type = ElementType::uint8;  // of numeric columns
    std::vector<std::int64_t> row_shape;    // of numeric columns
    std::int64_t row_bytes = 0;             // bytes of a number row, width of a text; 0 for blobs
    std::uint64_t file_offset = 0;
    std::vector<std::int64_t> blob_offsets;  // rows + 1, ascending from 0; of blobs
  };

  // Opens and checks the whole layout: signature, types, extents, offsets, and that every column lies inside
  // the file. Throws std::runtime_error naming path, dataset, got and expected.
  explicit TableReader(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return file_.path(); }
  std::int64_t rows() const { return rows_; }
  const std::map<std::string, std::string>& attributes() const { return attributes_; }
  const std::map<std::string, Column>& columns() const { return columns_; }

  // Rows [first, first + count) of a column. Throw std::runtime_error naming path and column when it is
  // absent or of another kind, std::out_of_range for rows that the table lacks.
  NumericColumn numeric(const std::string& name, std::int64_t first, std::int64_t count) const;
  std::vector<std::string> text(const std::string& name, std::int64_t first, std::int64_t count) const;
  std::vector<std::vector<std::byte>> blobs(const std::string& name, std::int64_t first,
                                            std::int64_t count) const;

 private:
  const Column& find(const std::string& name, Kind kind, std::int64_t first, std::int64_t count) const;

  FileDescriptor file_;
  std::int64_t rows_ = 0;
  std::map<std::string, std::string> attributes_;
  std::map<std::string, Column> columns_;
};

}  // namespace q3d::manifests
