#include "loaders/formats/hdf5_claims.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace q3d::loaders::formats {
namespace {

using manifests::hdf5::check;
using manifests::hdf5::Handle;

constexpr std::uint64_t kMaxBytes = std::uint64_t{4} << 30U;
constexpr std::uint64_t kMaxCompression = 1100;  // deflate reaches 1032
constexpr int kMaxDimensions = 8;

}  // namespace

void refuse(const std::string& where, const std::string& got, const std::string& expected) {
  throw std::runtime_error(fmt::format("{}: got {}, expected {}", where, got, expected));
}

ClaimedDataset open_dataset(hid_t parent, const std::string& name, const std::string& where) {
  Handle dataset(H5Dopen2(parent, name.c_str(), H5P_DEFAULT), H5Dclose, where);
  Handle type(H5Dget_type(dataset.get()), H5Tclose, where);
  const Handle space(H5Dget_space(dataset.get()), H5Sclose, where);
  const Handle creation(H5Dget_create_plist(dataset.get()), H5Pclose, where);
  if (H5Pget_external_count(creation.get()) != 0)
    refuse(where, "a dataset whose bytes lie in another file", "one whose bytes lie in this file");
  const int dimensions = check(H5Sget_simple_extent_ndims(space.get()), where);
  if (dimensions > kMaxDimensions)
    refuse(where, fmt::format("{} dimensions", dimensions), fmt::format("at most {}", kMaxDimensions));
  std::vector<hsize_t> extents(static_cast<std::size_t>(dimensions));
  check(H5Sget_simple_extent_dims(space.get(), extents.data(), nullptr), where);
  return {std::move(dataset), std::move(type), std::move(extents)};
}

std::uint64_t checked_count(const ClaimedDataset& dataset, std::uint64_t element_bytes,
                            std::uint64_t file_bytes, const std::string& where) {
  std::uint64_t count = 1;
  std::uint64_t bytes = element_bytes;
  bool overflows = false;
  for (const hsize_t extent : dataset.extents) {
    overflows = overflows || __builtin_mul_overflow(count, extent, &count);
  }
  overflows = overflows || __builtin_mul_overflow(bytes, count, &bytes);
  const std::uint64_t stored = std::min<std::uint64_t>(H5Dget_storage_size(dataset.id.get()), file_bytes);
  if (overflows || bytes > kMaxBytes || bytes > kMaxCompression * stored) {
    refuse(where,
           fmt::format("a claim of {} bytes in a file of {}", overflows ? "2^64" : std::to_string(bytes),
                       file_bytes),
           "at most what such a file can hold");
  }
  return count;
}

std::optional<ClaimedAttribute> open_attribute(hid_t object, const std::string& attribute,
                                               std::uint64_t file_bytes, const std::string& where) {
  if (check(H5Aexists(object, attribute.c_str()), where) == 0) return std::nullopt;
  Handle opened(H5Aopen(object, attribute.c_str(), H5P_DEFAULT), H5Aclose, where);
  Handle type(H5Aget_type(opened.get()), H5Tclose, where);
  Handle space(H5Aget_space(opened.get()), H5Sclose, where);
  if (H5Sget_simple_extent_npoints(space.get()) != 1) refuse(where, "a list of values", "a single value");
  if (H5Tget_size(type.get()) > file_bytes)
    refuse(where, "a value that is larger than the file", "one that the file can hold");
  return ClaimedAttribute{std::move(opened), std::move(type), std::move(space)};
}

std::string fixed_text(const ClaimedAttribute& attribute, const std::string& where) {
  std::string text(H5Tget_size(attribute.type.get()), '\0');
  check(H5Aread(attribute.id.get(), attribute.type.get(), text.data()), where);
  return text_from(text.data(), text.size());
}

std::string text_from(const char* start, std::size_t size) {
  return {start, std::find(start, start + size, '\0')};
}

}  // namespace q3d::loaders::formats
