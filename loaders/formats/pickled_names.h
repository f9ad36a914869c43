// Reads the column names of a pandas table, which PyTables keeps as a pickle in an attribute.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace q3d::loaders::formats {

// Returns the inner list of the pickle of `[(1, [("scorer", "snout", "x"), ...])]` (attribute
// non_index_axes).
//
// The pickle is read as data: a stack of lists, tuples, texts and whole numbers in the text protocol (0),
// which PyTables writes. Anything that could name or call code is refused. Throws std::runtime_error that
// names `where` and the byte, what was found and what was expected.
std::vector<std::vector<std::string>> read_pickled_columns(std::string_view pickle, const std::string& where);

}  // namespace q3d::loaders::formats
