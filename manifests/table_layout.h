// The positions of a table's columns in its file.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "manifests/table_reader.h"

namespace q3d::manifests {

struct TableLayout {
  std::int64_t rows = 0;
  std::map<std::string, std::string> attributes;
  std::map<std::string, TableReader::Column> columns;
};

// Opens the content with HDF5 and makes all the checks that TableReader promises. A file on disk is opened a
// second time.
TableLayout read_table_layout(const TableContent& content);

}  // namespace q3d::manifests
