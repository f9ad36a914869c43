// Reads a pandas DataFrame in HDF5, as DataFrame.to_hdf writes it with PyTables. There are two layouts:
//
// fixed, for labels made by hand
//   <key>/block0_values                  (rows, columns) floats
//   <key>/block0_items_level0, 1, ...    the names of each level of the columns
//   <key>/block0_items_label0, 1, ...    (columns) indices into them
//   <key>/axis1                          (rows) names of pictures, or axis1_levelI and axis1_labelI
// table, for predictions
//   <key>/table                          (rows) of { index, values_block_0[columns] }
//   <key>.attrs["non_index_axes"]        the columns' names, pickled
//
// Every claim of the file is checked against its size before memory is taken for it. That is not enough: HDF5
// 1.10 reads beyond its own buffers where an attribute's name is damaged (H5O__attr_exists), so the file is
// read in a process of its own.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "loaders/formats/hdf5_claims.h"
#include "loaders/formats/label_table.h"
#include "loaders/formats/pickled_names.h"
#include "loaders/formats/sleap.h"
#include "manifests/hdf5.h"
#include "manifests/own_process.h"

namespace q3d::loaders::formats {
namespace {

using manifests::hdf5::check;
using manifests::hdf5::Handle;

constexpr std::int64_t kMaxLevels = 8;
constexpr std::chrono::seconds kMaxTime{600};

// Refuses links, because they could lead to another file.
void require_own(hid_t parent, const std::string& name, const std::string& where) {
  H5L_info_t link{};
  if (H5Lexists(parent, name.c_str(), H5P_DEFAULT) <= 0) refuse(where, "nothing", "an object of this name");
  check(H5Lget_info(parent, name.c_str(), &link, H5P_DEFAULT), where);
  if (link.type != H5L_TYPE_HARD) refuse(where, "a link to another place", "an object of this file");
}

class PandasGroup {
 public:
  PandasGroup(hid_t file, std::string name, std::uint64_t file_bytes)
      : name_((require_own(file, name, name), std::move(name))),
        group_(H5Gopen2(file, name_.c_str(), H5P_DEFAULT), H5Gclose, name_),
        file_bytes_(file_bytes) {}

  hid_t id() const { return group_.get(); }
  std::string path(const std::string& member) const { return name_ + "/" + member; }

  std::string text_attribute(const std::string& attribute) const;
  std::int64_t integer_attribute(const std::string& attribute) const;
  ClaimedDataset open(const std::string& member, std::size_t rank) const;
  // Throws if the file cannot hold what the dataset claims.
  void check_size(const ClaimedDataset& dataset, const std::string& member,
                  std::uint64_t element_bytes) const;

  std::vector<std::string> names(const std::string& member) const;  // texts, or whole numbers as text
  std::vector<std::int64_t> integers(const std::string& member) const;
  // Returns rows of names from `<prefix>_levelI` and `<prefix>_labelI`.
  std::vector<std::vector<std::string>> multi_index(const std::string& prefix) const;

 private:
  std::string name_;
  Handle group_;
  std::uint64_t file_bytes_;
};

std::string PandasGroup::text_attribute(const std::string& attribute) const {
  const std::string where = name_ + "." + attribute;
  const auto opened = open_attribute(id(), attribute, file_bytes_, where);
  if (!opened) refuse(where, "nothing", "a text");
  if (H5Tget_class(opened->type.get()) != H5T_STRING || H5Tis_variable_str(opened->type.get()) != 0) {
    refuse(where, "another type", "one text of fixed length");
  }
  return fixed_text(*opened, where);
}

std::int64_t PandasGroup::integer_attribute(const std::string& attribute) const {
  const std::string where = name_ + "." + attribute;
  const auto opened = open_attribute(id(), attribute, file_bytes_, where);
  if (!opened) refuse(where, "nothing", "a whole number");
  if (H5Tget_class(opened->type.get()) != H5T_INTEGER) refuse(where, "another type", "a whole number");
  std::int64_t value = 0;
  check(H5Aread(opened->id.get(), H5T_NATIVE_INT64, &value), where);
  return value;
}

ClaimedDataset PandasGroup::open(const std::string& member, std::size_t rank) const {
  const std::string where = path(member);
  H5O_info_t object{};
  require_own(id(), member, where);
  check(H5Oget_info_by_name(id(), member.c_str(), &object, H5P_DEFAULT), where);
  if (object.type != H5O_TYPE_DATASET) refuse(where, "an object of another kind", "a dataset");
  ClaimedDataset dataset = open_dataset(id(), member, where);
  if (dataset.extents.size() != rank) {
    refuse(where, fmt::format("{} dimensions", dataset.extents.size()), std::to_string(rank));
  }
  return dataset;
}

void PandasGroup::check_size(const ClaimedDataset& dataset, const std::string& member,
                             std::uint64_t element_bytes) const {
  checked_count(dataset, element_bytes, file_bytes_, path(member));
}

std::vector<std::int64_t> PandasGroup::integers(const std::string& member) const {
  const ClaimedDataset dataset = open(member, 1);
  if (H5Tget_class(dataset.type.get()) != H5T_INTEGER) refuse(path(member), "another type", "whole numbers");
  check_size(dataset, member, sizeof(std::int64_t));
  std::vector<std::int64_t> values(dataset.extents[0]);
  if (values.empty()) return values;
  check(H5Dread(dataset.id.get(), H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()),
        path(member));
  return values;
}

std::vector<std::string> PandasGroup::names(const std::string& member) const {
  const ClaimedDataset dataset = open(member, 1);
  const H5T_class_t kind = H5Tget_class(dataset.type.get());
  std::vector<std::string> names;
  if (kind == H5T_INTEGER) {
    for (const std::int64_t value : integers(member)) names.push_back(std::to_string(value));
    return names;
  }
  if (kind != H5T_STRING || H5Tis_variable_str(dataset.type.get()) != 0) {
    refuse(path(member), "pickled Python objects or another type",
           "texts of fixed length; save the table as CSV instead");
  }
  const std::size_t width = H5Tget_size(dataset.type.get());
  check_size(dataset, member, width);
  std::string bytes(width * dataset.extents[0], '\0');
  if (bytes.empty()) return names;
  check(H5Dread(dataset.id.get(), dataset.type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()),
        path(member));
  for (std::size_t at = 0; at < bytes.size(); at += width) names.push_back(text_from(&bytes[at], width));
  return names;
}

std::vector<std::vector<std::string>> PandasGroup::multi_index(const std::string& prefix) const {
  const std::int64_t levels = integer_attribute(prefix + "_nlevels");
  if (levels < 1 || levels > kMaxLevels) {
    refuse(name_ + "." + prefix + "_nlevels", std::to_string(levels), fmt::format("1 to {}", kMaxLevels));
  }
  std::vector<std::vector<std::string>> rows;
  for (std::int64_t level = 0; level < levels; ++level) {
    const std::vector<std::string> known = names(fmt::format("{}_level{}", prefix, level));
    const std::string labels_name = fmt::format("{}_label{}", prefix, level);
    const std::vector<std::int64_t> labels = integers(labels_name);
    if (level == 0) rows.resize(labels.size());
    if (labels.size() != rows.size()) {
      refuse(path(labels_name), fmt::format("{} entries", labels.size()), std::to_string(rows.size()));
    }
    for (std::size_t i = 0; i < labels.size(); ++i) {
      if (labels[i] < 0 || labels[i] >= static_cast<std::int64_t>(known.size())) {
        refuse(path(labels_name), fmt::format("{}", labels[i]), fmt::format("0 to {}", known.size() - 1));
      }
      rows[i].push_back(known[static_cast<std::size_t>(labels[i])]);
    }
  }
  return rows;
}

void set_columns(std::vector<std::vector<std::string>> names, const PandasGroup& group, LabelTable& table) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    table.columns.push_back(label_column(std::move(names[i]), group.path(fmt::format("column {}", i))));
  }
}

void read_fixed(const PandasGroup& group, LabelTable& table) {
  if (const std::int64_t blocks = group.integer_attribute("nblocks"); blocks != 1) {
    refuse(group.path("nblocks"), std::to_string(blocks),
           "1, because all columns must have one number type; save the table as CSV instead");
  }
  set_columns(group.multi_index("block0_items"), group, table);
  if (group.text_attribute("axis1_variety") == "multi") {
    for (const auto& parts : group.multi_index("axis1")) table.rows.push_back(row_name(parts));
  } else {
    const ClaimedDataset index = group.open("axis1", 1);
    table.rows_are_numbers = H5Tget_class(index.type.get()) == H5T_INTEGER;
    for (const std::string& name : group.names("axis1")) table.rows.push_back(row_name({name}));
  }
  const ClaimedDataset values = group.open("block0_values", 2);
  if (H5Tget_class(values.type.get()) != H5T_FLOAT)
    refuse(group.path("block0_values"), "another type", "floats");
  if (values.extents[0] != table.rows.size() || values.extents[1] != table.columns.size()) {
    refuse(group.path("block0_values"), fmt::format("{} x {} numbers", values.extents[0], values.extents[1]),
           fmt::format("{} rows x {} columns", table.rows.size(), table.columns.size()));
  }
  group.check_size(values, "block0_values", sizeof(double));
  table.values.resize(table.rows.size() * table.columns.size());
  if (table.values.empty()) return;
  check(H5Dread(values.id.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, table.values.data()),
        group.path("block0_values"));
}

// The memory layout of the parts of a row that are read: the index, then the numbers.
struct TableRow {
  Handle type;
  std::size_t index_bytes;
  bool index_is_number;
};

TableRow table_row(const PandasGroup& group, const ClaimedDataset& table, std::size_t columns) {
  const std::string where = group.path("table");
  if (H5Tget_class(table.type.get()) != H5T_COMPOUND || H5Tget_nmembers(table.type.get()) != 2 ||
      H5Tget_member_index(table.type.get(), "index") != 0 ||
      H5Tget_member_index(table.type.get(), "values_block_0") != 1) {
    refuse(where, "other fields", "index and values_block_0, because all columns must have one number type");
  }
  const Handle index(H5Tget_member_type(table.type.get(), 0), H5Tclose, where);
  const Handle block(H5Tget_member_type(table.type.get(), 1), H5Tclose, where);
  hsize_t width = 0;
  if (H5Tget_class(block.get()) != H5T_ARRAY || H5Tget_array_ndims(block.get()) != 1 ||
      H5Tget_array_dims2(block.get(), &width) < 0 || width != columns) {
    refuse(where + ".values_block_0", fmt::format("another type, or {} numbers", width),
           fmt::format("{} numbers in a row, one for each column name", columns));
  }
  const Handle element(H5Tget_super(block.get()), H5Tclose, where);
  if (H5Tget_class(element.get()) != H5T_FLOAT) refuse(where + ".values_block_0", "another type", "floats");
  const bool is_number = H5Tget_class(index.get()) == H5T_INTEGER;
  if (!is_number && (H5Tget_class(index.get()) != H5T_STRING || H5Tis_variable_str(index.get()) != 0)) {
    refuse(where + ".index", "another type", "whole numbers or texts of fixed length");
  }
  const std::size_t index_bytes = is_number ? sizeof(std::int64_t) : H5Tget_size(index.get());
  const hsize_t extent = columns;
  const Handle numbers(H5Tarray_create2(H5T_NATIVE_DOUBLE, 1, &extent), H5Tclose, where);
  Handle row(H5Tcreate(H5T_COMPOUND, index_bytes + columns * sizeof(double)), H5Tclose, where);
  check(H5Tinsert(row.get(), "index", 0, is_number ? H5T_NATIVE_INT64 : index.get()), where);
  check(H5Tinsert(row.get(), "values_block_0", index_bytes, numbers.get()), where);
  return {std::move(row), index_bytes, is_number};
}

void read_rows(const PandasGroup& group, LabelTable& table) {
  set_columns(read_pickled_columns(group.text_attribute("non_index_axes"), group.path("non_index_axes")),
              group, table);
  const std::size_t columns = table.columns.size();
  if (columns == 0) refuse(group.path("non_index_axes"), "no columns", "at least one");
  const ClaimedDataset stored = group.open("table", 1);
  const TableRow row = table_row(group, stored, columns);
  const std::size_t row_bytes = row.index_bytes + columns * sizeof(double);
  group.check_size(stored, "table", row_bytes);
  std::vector<char> bytes(row_bytes * stored.extents[0]);
  if (bytes.empty()) return;
  check(H5Dread(stored.id.get(), row.type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()),
        group.path("table"));
  table.rows_are_numbers = row.index_is_number;
  table.values.resize(columns * stored.extents[0]);
  for (std::size_t i = 0; i < stored.extents[0]; ++i) {
    const char* start = bytes.data() + i * row_bytes;
    std::int64_t number = 0;
    std::memcpy(&number, start, std::min(row.index_bytes, sizeof(number)));
    table.rows.push_back(row.index_is_number ? std::to_string(number)
                                             : row_name({text_from(start, row.index_bytes)}));
    std::memcpy(&table.values[i * columns], start + row.index_bytes, columns * sizeof(double));
  }
}

// Joins the first few names of a file, which could have thousands.
std::string joined_names(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 20;
  std::string text = fmt::format(
      "{}", fmt::join(names.begin(),
                      names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kShown)), ", "));
  return names.size() > kShown ? text + fmt::format(" and {} more", names.size() - kShown) : text;
}

// Returns the group that holds the DataFrame: the one with DeepLabCut's name, else the only group of the
// file.
std::string frame_group(hid_t file) {
  constexpr const char* kUsual = "df_with_missing";
  if (H5Lexists(file, kUsual, H5P_DEFAULT) > 0) return kUsual;
  const std::vector<std::string> names = manifests::hdf5::link_names(file, "root group");
  if (names.size() == 1) return names.front();
  refuse(
      "root group", fmt::format("the members {}", names.empty() ? "(none)" : joined_names(names)),
      fmt::format("{}, or one table alone, or SLEAP's labels or analysis. Save the table that you want under "
                  "this key",
                  kUsual));
}

LabelTable read_open_file(hid_t file, std::uint64_t file_bytes) {
  const ForeignHdf5 opened(file, file_bytes);
  if (auto table = read_sleap_labels(opened)) return std::move(*table);
  if (auto table = read_sleap_analysis(opened)) return std::move(*table);
  const PandasGroup group(file, frame_group(file), file_bytes);
  const std::string layout = group.text_attribute("pandas_type");
  LabelTable table;
  if (layout == "frame") {
    read_fixed(group, table);
  } else if (layout == "frame_table") {
    read_rows(group, table);
  } else {
    refuse(group.path("pandas_type"), fmt::format("\"{}\"", layout), "frame or frame_table");
  }
  return table;
}

// These convert a table to bytes and back, to pass it between two processes of one machine.
std::string packed(const LabelTable& table) {
  nlohmann::json columns = nlohmann::json::array();
  for (const LabelColumn& column : table.columns) {
    columns.push_back({column.scorer, column.individual, column.bodypart, column.coordinate});
  }
  nlohmann::json videos = nlohmann::json::array();
  for (const LabelVideo& video : table.videos)
    videos.push_back({video.name, video.width_px, video.height_px});
  const auto* values = reinterpret_cast<const std::uint8_t*>(table.values.data());
  std::string bytes;
  nlohmann::json::to_cbor(
      {{"columns", std::move(columns)},
       {"rows", table.rows},
       {"rows_are_numbers", table.rows_are_numbers},
       {"videos", std::move(videos)},
       {"video_of_row", table.video_of_row},
       {"values", nlohmann::json::binary({values, values + table.values.size() * sizeof(double)})}},
      bytes);
  return bytes;
}

LabelTable unpacked(const std::string& bytes) {
  const nlohmann::json object = nlohmann::json::from_cbor(bytes);
  LabelTable table;
  for (const nlohmann::json& names : object.at("columns")) {
    table.columns.push_back({names.at(0), names.at(1), names.at(2), names.at(3)});
  }
  table.rows = object.at("rows").get<std::vector<std::string>>();
  table.rows_are_numbers = object.at("rows_are_numbers");
  for (const nlohmann::json& video : object.at("videos")) {
    table.videos.push_back({video.at(0), video.at(1), video.at(2)});
  }
  table.video_of_row = object.at("video_of_row").get<std::vector<std::size_t>>();
  const auto& values = object.at("values").get_binary();
  table.values.resize(values.size() / sizeof(double));
  if (!values.empty()) std::memcpy(table.values.data(), values.data(), values.size());
  return table;
}

// Must be called with HDF5's lock held.
LabelTable read_file(const std::filesystem::path& file) {
  const Handle opened(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose, "HDF5");
  return read_open_file(opened.get(), std::filesystem::file_size(file));
}

// Calls `read` and adds the file's name to the error if it fails.
template <typename Read>
LabelTable naming(const std::filesystem::path& file, Read read) {
  try {
    return read();
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace

LabelTable read_label_hdf5(const std::filesystem::path& file) {
  // The lock is taken here, because no other thread may hold it when the child begins.
  const manifests::hdf5::Session session;
  return naming(file, [&file] {
    return unpacked(manifests::in_own_process([&file] { return packed(read_file(file)); }, kMaxTime));
  });
}

LabelTable read_label_hdf5_here(const std::filesystem::path& file) {
  const manifests::hdf5::Session session;
  return naming(file, [&file] { return read_file(file); });
}

}  // namespace q3d::loaders::formats
