#include "manifests/table_reader.h"

#include <fmt/format.h>

#include <array>
#include <stdexcept>
#include <utility>

#include "manifests/table_layout.h"

namespace q3d::manifests {

TableReader::TableReader(const std::filesystem::path& path) : TableReader(TableContent(path)) {}

TableReader::TableReader(TableContent content) : content_(std::move(content)) {
  TableLayout layout = read_table_layout(content_);
  rows_ = layout.rows;
  attributes_ = std::move(layout.attributes);
  columns_ = std::move(layout.columns);
}

const TableReader::Column& TableReader::find(const std::string& name, Kind kind, std::int64_t first,
                                             std::int64_t count) const {
  constexpr std::array<std::string_view, 3> kKindNames{"numeric", "text", "blob"};
  const auto found = columns_.find(name);
  if (found == columns_.end()) {
    throw std::runtime_error(fmt::format("{}: no column {}", path().string(), name));
  }
  if (found->second.kind != kind) {
    throw std::runtime_error(fmt::format("{}: column {} is {}, expected {}", path().string(), name,
                                         kKindNames.at(static_cast<std::size_t>(found->second.kind)),
                                         kKindNames.at(static_cast<std::size_t>(kind))));
  }
  if (first < 0 || count < 0 || first > rows_ || count > rows_ - first) {
    throw std::out_of_range(fmt::format("{}: {} rows from {} on of column {}, which has {}", path().string(),
                                        count, first, name, rows_));
  }
  return found->second;
}

NumericColumn TableReader::numeric(const std::string& name, std::int64_t first, std::int64_t count) const {
  const Column& column = find(name, Kind::numeric, first, count);
  NumericColumn values{column.type, column.row_shape,
                       std::vector<std::byte>(static_cast<std::size_t>(count * column.row_bytes))};
  content_.read_at(column.file_offset + static_cast<std::uint64_t>(first * column.row_bytes), values.data);
  return values;
}

std::vector<std::string> TableReader::text(const std::string& name, std::int64_t first,
                                           std::int64_t count) const {
  const Column& column = find(name, Kind::text, first, count);
  const auto width = static_cast<std::size_t>(column.row_bytes);
  std::string padded(static_cast<std::size_t>(count) * width, '\0');
  content_.read_at(column.file_offset + static_cast<std::uint64_t>(first * column.row_bytes),
                   std::as_writable_bytes(std::span(padded)));
  std::vector<std::string> values;
  values.reserve(static_cast<std::size_t>(count));
  for (std::size_t at = 0; at < padded.size(); at += width) {
    const std::string_view field = std::string_view(padded).substr(at, width);
    values.emplace_back(field.substr(0, field.find('\0')));
  }
  return values;
}

std::vector<std::vector<std::byte>> TableReader::blobs(const std::string& name, std::int64_t first,
                                                       std::int64_t count) const {
  const auto& column = find(name, Kind::blob, first, count);
  std::vector<std::vector<std::byte>> values;
  values.reserve(static_cast<std::size_t>(count));
  for (auto row = static_cast<std::size_t>(first); row < static_cast<std::size_t>(first + count); ++row) {
    const std::int64_t begin = column.blob_offsets[row];
    values.emplace_back(static_cast<std::size_t>(column.blob_offsets[row + 1] - begin));
    content_.read_at(column.file_offset + static_cast<std::uint64_t>(begin), values.back());
  }
  return values;
}

namespace {

Table read_whole(const TableReader& reader) {
  Table table;
  table.rows = reader.rows();
  table.attributes = reader.attributes();
  for (const auto& [name, column] : reader.columns()) {
    switch (column.kind) {
      case TableReader::Kind::numeric:
        table.numeric.emplace(name, reader.numeric(name, 0, table.rows));
        break;
      case TableReader::Kind::text:
        table.text.emplace(name, reader.text(name, 0, table.rows));
        break;
      case TableReader::Kind::blob:
        table.blobs.emplace(name, reader.blobs(name, 0, table.rows));
        break;
    }
  }
  return table;
}

}  // namespace

Table read_table(const std::filesystem::path& path) {
  return read_whole(TableReader(path));
}

Table read_table(const std::filesystem::path& path, std::vector<std::byte> bytes) {
  return read_whole(TableReader(TableContent(path, std::move(bytes))));
}

}  // namespace q3d::manifests
