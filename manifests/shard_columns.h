// The columns of the schemas. The shard's writer, its reader, its self-description and the document all
// follow this list.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "manifests/shard.h"
#include "manifests/table.h"

namespace q3d::manifests {

struct NumberColumn {
  ElementType type;
  std::vector<std::int64_t> row_shape;
  // These copy one row from the sample and to the sample. `load` may throw std::runtime_error.
  std::function<void(const ShardSample&, std::byte* row)> store;
  std::function<void(ShardSample&, const std::byte* row)> load;
};
struct TextColumn {
  std::function<std::string(const ShardSample&)> store;
  std::function<void(ShardSample&, std::string)> load;  // may throw std::invalid_argument
};
struct BytesColumn {
  std::vector<std::byte> ShardSample::*member;
};

struct ShardColumn {
  std::string name;
  std::string units;  // empty if the column has none
  std::string meaning;
  std::variant<NumberColumn, TextColumn, BytesColumn> content;
  int since = 1;  // the first schema that has the column
};

// Returns the columns of the newest schema in the order of docs/shard-format.md. An older schema has those
// whose `since` is not above it. Loading uses the same order, so truth_present comes before the columns that
// depend on it.
const std::vector<ShardColumn>& shard_columns();

std::string dtype_of(const ShardColumn& column);  // "float32", ..., "text", "bytes"
std::string shape_of(const ShardColumn& column);  // "(rows, 26, 2)"

}  // namespace q3d::manifests
