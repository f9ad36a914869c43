// Checks the claims of an HDF5 file that another program wrote and that may be damaged. Every claim is
// checked against the file's size before memory is taken for it, and links to other files are not followed.
// HDF5's lock must be held. All functions throw std::runtime_error that names the object (`where`), what was
// found and what was expected.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "manifests/hdf5.h"

namespace q3d::loaders::formats {

// Throws "<where>: got <got>, expected <expected>".
[[noreturn]] void refuse(const std::string& where, const std::string& got, const std::string& expected);

struct ClaimedDataset {
  manifests::hdf5::Handle id;
  manifests::hdf5::Handle type;
  std::vector<hsize_t> extents;  // none for a scalar
};

// Opens a dataset. Refuses more than eight dimensions, and bytes that lie in another file.
ClaimedDataset open_dataset(hid_t parent, const std::string& name, const std::string& where);

// Returns the number of elements. Refuses a dataset whose elements, of `element_bytes` in memory each, a file
// of `file_bytes` cannot hold.
std::uint64_t checked_count(const ClaimedDataset& dataset, std::uint64_t element_bytes,
                            std::uint64_t file_bytes, const std::string& where);

struct ClaimedAttribute {
  manifests::hdf5::Handle id;
  manifests::hdf5::Handle type;
  manifests::hdf5::Handle space;
};

// Opens an attribute that holds a single value; returns nothing if the object has none of this name. Refuses
// a list of values, and a value that is larger than the file.
std::optional<ClaimedAttribute> open_attribute(hid_t object, const std::string& attribute,
                                               std::uint64_t file_bytes, const std::string& where);

// Reads a text of fixed length. The attribute's type must be such a text.
std::string fixed_text(const ClaimedAttribute& attribute, const std::string& where);

// Returns the text in a field of `size` bytes, which ends at the first NUL.
std::string text_from(const char* start, std::size_t size);

}  // namespace q3d::loaders::formats
