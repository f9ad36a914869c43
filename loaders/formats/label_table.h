// DeepLabCut's tables have one row for each frame and one column for each coordinate of a keypoint (of an
// individual). DeepLabCut writes each table as CSV and as a pandas DataFrame in HDF5.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace q3d::loaders::formats {

// The meaning of a column.
struct LabelColumn {
  std::string scorer;
  std::string individual;  // empty in tables of one animal
  std::string bodypart;
  std::string coordinate;  // x, y or likelihood
};

// A video to which frames of the table belong, as far as the file says.
struct LabelVideo {
  std::string name;  // name of its file, without folders and extension
  int width_px = 0;  // 0: unknown
  int height_px = 0;
};

struct LabelTable {
  std::vector<LabelColumn> columns;
  // The name of each row: a picture's name with its folders, which the file may keep in several parts, or the
  // number of a frame.
  std::vector<std::string> rows;
  bool rows_are_numbers = false;
  std::vector<double> values;               // (rows, columns), px; NaN where nothing was labelled
  std::vector<LabelVideo> videos{};         // empty if the file names none
  std::vector<std::size_t> video_of_row{};  // an index into the videos for each row; empty without videos

  double at(std::size_t row, std::size_t column) const { return values[row * columns.size() + column]; }
};

// Reads a table, HDF5 or CSV, recognised by content. Throws std::runtime_error that names file and place,
// what was found and what was expected.
// Throws manifests::IoError if the file exists and cannot be read.
LabelTable read_label_table(const std::filesystem::path& file);
bool is_hdf5(const std::filesystem::path& file);

// These read one of the two forms. HDF5 is read in a separate process, because a damaged file can crash that
// library.
LabelTable read_label_csv(const std::filesystem::path& file);
LabelTable read_label_hdf5(const std::filesystem::path& file);

// Reads HDF5 in this process, for fuzzing, which cannot see another process.
LabelTable read_label_hdf5_here(const std::filesystem::path& file);

// Says how `other`, which is another file of the same labels, differs from `table`: in its rows, or in
// numbers by more than 0.5 px ("which differs from it in 2 numbers, ..."). Returns "" if it does not.
std::string difference_of(const LabelTable& table, const LabelTable& other);

// Makes a column from its names on the levels of the header, scorer first. There are three names, or four
// with individuals. Throws std::runtime_error that names `where` for another number of names.
LabelColumn label_column(std::vector<std::string> names, const std::string& where);

// Joins the parts of a row's name: "labeled-data", "walk", "img1.png" -> "labeled-data/walk/img1.png".
// Windows' separators become '/'.
std::string row_name(const std::vector<std::string>& parts);

}  // namespace q3d::loaders::formats
