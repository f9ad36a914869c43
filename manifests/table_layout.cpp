#include "manifests/table_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "manifests/file_stamp.h"
#include "manifests/hdf5.h"
#include "manifests/hdf5_memory_file.h"
#include "manifests/own_process.h"

namespace q3d::manifests {
namespace {

using hdf5::check;
using hdf5::Handle;

constexpr std::string_view kOffsetsSuffix = "_offsets";

[[noreturn]] void refuse(const std::string& name, const std::string& why) {
  throw std::runtime_error(fmt::format("{}: {}", name, why));
}

// The position of one dataset, which was checked to lie inside the file.
struct Layout {
  std::optional<ElementType> type;  // empty: text
  std::vector<std::int64_t> extents;
  std::int64_t row_bytes = 0;
  std::int64_t bytes = 0;
  std::uint64_t file_offset = 0;
};

std::optional<ElementType> numeric_type(hid_t type) {
  const std::array<std::pair<hid_t, ElementType>, 6> known{{{H5T_IEEE_F32LE, ElementType::float32},
                                                            {H5T_IEEE_F64LE, ElementType::float64},
                                                            {H5T_STD_I8LE, ElementType::int8},
                                                            {H5T_STD_U8LE, ElementType::uint8},
                                                            {H5T_STD_I32LE, ElementType::int32},
                                                            {H5T_STD_I64LE, ElementType::int64}}};
  for (const auto& [stored, element] : known) {
    if (check(H5Tequal(type, stored), "compare types") > 0) return element;
  }
  return std::nullopt;
}

bool is_fixed_text(hid_t type) {
  return H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) == 0;
}

void multiply(const std::string& name, std::int64_t& bytes, std::int64_t extent) {
  if (__builtin_mul_overflow(bytes, extent, &bytes))
    refuse(name, fmt::format("an extent of {} overflows", extent));
}

void read_extents(const std::string& name, hid_t dataset, std::int64_t element_bytes, Layout& layout) {
  const Handle space(H5Dget_space(dataset), H5Sclose, name);
  const int rank = check(H5Sget_simple_extent_ndims(space.get()), name);
  if (rank < 1) refuse(name, "got a scalar, expected one entry a row");
  std::vector<hsize_t> extents(static_cast<std::size_t>(rank));
  check(H5Sget_simple_extent_dims(space.get(), extents.data(), nullptr), name);
  for (const hsize_t extent : extents) {
    if (!std::in_range<std::int64_t>(extent)) refuse(name, fmt::format("an extent of {} overflows", extent));
    layout.extents.push_back(static_cast<std::int64_t>(extent));
  }
  // Compute the size of a row first: a table without rows must not hide a row whose size overflows.
  layout.row_bytes = element_bytes;
  for (std::size_t axis = 1; axis < layout.extents.size(); ++axis) {
    if (layout.extents[axis] == 0) refuse(name, fmt::format("axis {} is empty", axis));
    multiply(name, layout.row_bytes, layout.extents[axis]);
  }
  layout.bytes = layout.row_bytes;
  multiply(name, layout.bytes, layout.extents[0]);
}

Layout read_layout(const std::string& name, hid_t file, std::uint64_t file_bytes) {
  H5L_info_t link{};
  check(H5Lget_info(file, name.c_str(), &link, H5P_DEFAULT), name);
  H5O_info_t object{};
  if (link.type != H5L_TYPE_HARD) refuse(name, "is a link to elsewhere; a table holds plain datasets");
  check(H5Oget_info_by_name(file, name.c_str(), &object, H5P_DEFAULT), name);
  if (object.type != H5O_TYPE_DATASET) refuse(name, "is no dataset; a table holds plain datasets");

  const Handle dataset(H5Dopen2(file, name.c_str(), H5P_DEFAULT), H5Dclose, name);
  const Handle creation(H5Dget_create_plist(dataset.get()), H5Pclose, name);
  if (H5Pget_layout(creation.get()) != H5D_CONTIGUOUS || H5Pget_external_count(creation.get()) != 0) {
    refuse(name, "is not stored contiguously in this file");
  }
  const Handle type(H5Dget_type(dataset.get()), H5Tclose, name);
  Layout layout;
  layout.type = numeric_type(type.get());
  if (!layout.type && !is_fixed_text(type.get())) {
    refuse(name, "is neither of the six number types nor fixed-width text");
  }
  const std::size_t element_bytes = H5Tget_size(type.get());
  if (element_bytes == 0 || element_bytes > file_bytes) {
    refuse(name, fmt::format("entries of {} bytes in a file of {}", element_bytes, file_bytes));
  }
  read_extents(name, dataset.get(), static_cast<std::int64_t>(element_bytes), layout);
  if (layout.bytes == 0) return layout;
  layout.file_offset = H5Dget_offset(dataset.get());
  if (layout.file_offset > file_bytes ||
      static_cast<std::uint64_t>(layout.bytes) > file_bytes - layout.file_offset) {
    refuse(name, fmt::format("claims {} bytes, but the file has {}", layout.bytes, file_bytes));
  }
  return layout;
}

std::int64_t read_rows(hid_t file) {
  if (check(H5Aexists(file, "rows"), "rows") == 0) {
    refuse("rows", "the attribute is absent, so this HDF5 file is not one of this program's tables");
  }
  const Handle attribute(H5Aopen(file, "rows", H5P_DEFAULT), H5Aclose, "rows");
  const Handle type(H5Aget_type(attribute.get()), H5Tclose, "rows");
  const Handle space(H5Aget_space(attribute.get()), H5Sclose, "rows");
  if (H5Tequal(type.get(), H5T_STD_I64LE) <= 0 || H5Sget_simple_extent_npoints(space.get()) != 1) {
    refuse("rows", "expected one int64");
  }
  std::int64_t rows = 0;
  check(H5Aread(attribute.get(), H5T_STD_I64LE, &rows), "rows");
  if (rows < 0) refuse("rows", fmt::format("got {}", rows));
  return rows;
}

// Attributes of other types are skipped. A caller that needs one of them will notice that it is missing.
std::map<std::string, std::string> read_attributes(hid_t file, std::uint64_t file_bytes) {
  H5O_info_t root{};
  check(H5Oget_info(file, &root), "root group");
  std::map<std::string, std::string> attributes;
  for (hsize_t i = 0; i < root.num_attrs; ++i) {
    // List in native order; link_names() gives the reason.
    const Handle attribute(
        H5Aopen_by_idx(file, ".", H5_INDEX_NAME, H5_ITER_NATIVE, i, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
        "attributes");
    std::string name(static_cast<std::size_t>(check(H5Aget_name(attribute.get(), 0, nullptr), "attributes")),
                     '\0');
    check(H5Aget_name(attribute.get(), name.size() + 1, name.data()), "attributes");
    const Handle type(H5Aget_type(attribute.get()), H5Tclose, name);
    const Handle space(H5Aget_space(attribute.get()), H5Sclose, name);
    const std::size_t width = H5Tget_size(type.get());
    const bool one_text = is_fixed_text(type.get()) && H5Sget_simple_extent_npoints(space.get()) == 1;
    if (!one_text || width > file_bytes) continue;
    std::string value(width, '\0');
    check(H5Aread(attribute.get(), type.get(), value.data()), name);
    value.resize(std::min(value.find('\0'), value.size()));
    attributes.emplace(std::move(name), std::move(value));
  }
  return attributes;
}

std::vector<std::int64_t> read_offsets(const TableContent& file, const std::string& name, std::int64_t rows,
                                       const Layout& offsets, std::int64_t flat_bytes) {
  if (offsets.type != ElementType::int64 || offsets.extents.size() != 1 || offsets.extents[0] - 1 != rows) {
    refuse(name + "_offsets", fmt::format("expected {} rows + 1 of int64", rows));
  }
  std::vector<std::int64_t> values(static_cast<std::size_t>(rows) + 1);
  file.read_at(offsets.file_offset, std::as_writable_bytes(std::span(values)));
  if (values.front() != 0 || values.back() != flat_bytes || !std::is_sorted(values.begin(), values.end())) {
    refuse(name + "_offsets", fmt::format("must ascend from 0 to {}, the bytes of {}", flat_bytes, name));
  }
  return values;
}

TableReader::Column make_column(const std::string& name, std::int64_t rows, const Layout& layout) {
  const std::int64_t got = layout.extents[0];
  if (got != rows) refuse(name, fmt::format("got {} rows, expected {}", got, rows));
  TableReader::Column column;
  column.file_offset = layout.file_offset;
  column.row_bytes = layout.row_bytes;
  if (layout.type) {
    column.type = *layout.type;
    column.row_shape.assign(layout.extents.begin() + 1, layout.extents.end());
  } else {
    column.kind = TableReader::Kind::text;
    if (layout.extents.size() != 1) refuse(name, "text must have one axis");
  }
  return column;
}

std::map<std::string, TableReader::Column> read_columns(hid_t hdf5_file, const TableContent& file,
                                                        std::int64_t rows) {
  const std::uint64_t file_bytes = file.size();
  std::map<std::string, Layout> layouts;
  std::uint64_t total = 0;
  for (const std::string& name : hdf5::link_names(hdf5_file, "dataset names")) {
    const Layout& layout = layouts[name] = read_layout(name, hdf5_file, file_bytes);
    total += static_cast<std::uint64_t>(layout.bytes);
    // Overlapping datasets could claim the size of the file many times over.
    if (total > file_bytes) refuse(name, "the datasets together claim more bytes than the file has");
  }
  std::map<std::string, TableReader::Column> columns;
  for (const auto& [name, layout] : layouts) {
    if (name.ends_with(kOffsetsSuffix)) {
      const std::string flat = name.substr(0, name.size() - kOffsetsSuffix.size());
      if (!layouts.contains(flat)) refuse(name, fmt::format("its bytes, dataset {}, are absent", flat));
      continue;
    }
    const auto offsets = layouts.find(name + std::string(kOffsetsSuffix));
    if (offsets == layouts.end()) {
      columns.emplace(name, make_column(name, rows, layout));
      continue;
    }
    if (layout.type != ElementType::uint8 || layout.extents.size() != 1) refuse(name, "expected flat uint8");
    TableReader::Column column;
    column.kind = TableReader::Kind::blob;
    column.file_offset = layout.file_offset;
    column.blob_offsets = read_offsets(file, name, rows, offsets->second, layout.bytes);
    columns.emplace(name, std::move(column));
  }
  return columns;
}

Handle open_hdf5(const TableContent& content) {
  if (const auto bytes = content.in_memory()) return hdf5::open_image(*bytes);
  const std::filesystem::path& path = content.path();
  if (H5Fis_hdf5(path.c_str()) <= 0) throw std::runtime_error("not an HDF5 file");
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "file access properties");
  // Published shards may lie on read-only or network file systems, where HDF5's own locking fails.
  check(H5Pset_file_locking(access.get(), false, true), "file locking");
  return {H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.get()), H5Fclose, "cannot open"};
}

TableLayout layout_of(hid_t hdf5_file, const TableContent& content) {
  TableLayout layout;
  layout.rows = read_rows(hdf5_file);
  layout.attributes = read_attributes(hdf5_file, content.size());
  layout.columns = read_columns(hdf5_file, content, layout.rows);
  return layout;
}

// Files on disk may be shards that strangers made, and HDF5 1.10 can crash on a damaged one. So another
// process reads the file's layout first, once for each file. Bytes in memory are those of this program's own
// stages, which were compared with their digest. A Session must exist, so that no other thread holds HDF5's
// lock when the child begins. Throws std::runtime_error if the child crashed or hung.
void try_in_own_process(const TableContent& content) {
  static std::set<FileStamp> sound;  // stamps at the time of the check; guarded by the session's lock
  constexpr std::chrono::seconds kMaxTime{60};
  if (content.in_memory()) return;
  const auto stamp = stamp_of(content.path());
  if (!stamp) throw_errno("inspect", content.path());
  if (sound.contains(*stamp)) return;
  const auto read = [&content] {
    const Handle file = open_hdf5(content);
    layout_of(file.get(), content);
  };
  if (const auto crash = trial_in_own_process(read, kMaxTime)) throw std::runtime_error(*crash);
  sound.insert(*stamp);
}

// Calls `read(HDF5 file)` and puts the path before the message of an exception, unless the message already
// names it.
template <typename Read>
auto with_hdf5(const TableContent& content, Read read) {
  const hdf5::Session session;
  try {
    try_in_own_process(content);
    const Handle file = open_hdf5(content);
    return read(file.get());
  } catch (const IoError&) {
    throw;
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", content.path().string(), error.what()));
  }
}

}  // namespace

TableLayout read_table_layout(const TableContent& content) {
  return with_hdf5(content, [&](hid_t hdf5_file) { return layout_of(hdf5_file, content); });
}

std::map<std::string, std::string> read_table_attributes(const std::filesystem::path& path) {
  const TableContent content(path);
  return with_hdf5(content, [&](hid_t hdf5_file) { return read_attributes(hdf5_file, content.size()); });
}

}  // namespace q3d::manifests
