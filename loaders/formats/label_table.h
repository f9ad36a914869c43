// DeepLabCut's tables: one row a frame, one column a coordinate of a keypoint (of an individual). It writes
// each as CSV and as a pandas DataFrame in HDF5.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace q3d::loaders::formats {

// What a column holds.
struct LabelColumn {
  std::string scorer;
  std::string individual;  // empty in tables of one animal
  std::string bodypart;
  std::string coordinate;  // x, y or likelihood
};

struct LabelTable {
  std::vector<LabelColumn> columns;
  // A picture's name with its folders, however many parts the file keeps it in; or a frame's number.
  std::vector<std::string> rows;
  bool rows_are_numbers = false;
  std::vector<double> values;  // (rows, columns), px; NaN where nothing was labelled

  double at(std::size_t row, std::size_t column) const { return values[row * columns.size() + column]; }
};

// By content: HDF5 or CSV. Throws std::runtime_error naming file, place, got and expected.
LabelTable read_label_table(const std::filesystem::path& file);
bool is_hdf5(const std::filesystem::path& file);

// The two by themselves. HDF5 is read in a process of its own: a damaged file can crash that library.
LabelTable read_label_csv(const std::filesystem::path& file);
LabelTable read_label_hdf5(const std::filesystem::path& file);

// In this process, for fuzzing, which sees no other.
LabelTable read_label_hdf5_here(const std::filesystem::path& file);

// The names of a column, scorer first, as the file's levels give them: three, or four with individuals.
// Throws std::runtime_error for another number of them, naming `where`.
LabelColumn label_column(std::vector<std::string> names, const std::string& where);

// "labeled-data", "walk", "img1.png" -> "labeled-data/walk/img1.png"; Windows' separators become '/'.
std::string row_name(const std::vector<std::string>& parts);

}  // namespace q3d::loaders::formats
