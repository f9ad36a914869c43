// Reads HDF5 files that other programs wrote and that may be damaged. Every claim of the file is checked
// against its size before memory is taken for it, and links to other files are not followed. HDF5 itself can
// crash on a damaged file, so call these functions in a separate process (manifests/own_process.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/hdf5.h"

namespace q3d::loaders::formats {

// An open file. HDF5's lock must be held while it exists. All functions throw std::runtime_error that names
// the object, what was found and what was expected. Names are those of members of the root group.
class ForeignHdf5 {
 public:
  explicit ForeignHdf5(const std::filesystem::path& file);
  // Uses a file that is open already. It must outlive this object.
  ForeignHdf5(hid_t file, std::uint64_t file_bytes) : file_(file), file_bytes_(file_bytes) {}

  // Returns whether the file itself holds a dataset, or a group, of this name.
  bool has_dataset(const std::string& name) const;
  bool has_group(const std::string& name) const;

  // Returns the extents of a dataset; none for a scalar.
  std::vector<std::uint64_t> extents(const std::string& name) const;
  // Returns all numbers of a numeric dataset, row-major.
  std::vector<double> numbers(const std::string& name) const;
  // Returns all texts of a text dataset, of fixed or variable length.
  std::vector<std::string> texts(const std::string& name) const;

  // Returns the names of the fields of a table, which is a one-dimensional dataset of compounds.
  std::vector<std::string> fields(const std::string& name) const;
  // Returns one field of all rows of a table. Whole numbers above 2^53 lose digits.
  std::vector<double> field(const std::string& name, const std::string& field) const;

  // Returns an attribute of a group or dataset, or nothing if there is none of this name.
  std::optional<std::string> text_attribute(const std::string& object, const std::string& attribute) const;
  std::optional<double> number_attribute(const std::string& object, const std::string& attribute) const;

 private:
  struct Opened {
    manifests::hdf5::Handle id;
    manifests::hdf5::Handle type;
    std::vector<hsize_t> extents;
    std::uint64_t count;  // number of elements
  };
  bool has(const std::string& name, H5O_type_t kind) const;
  Opened open(const std::string& name, std::uint64_t element_bytes) const;

  std::optional<manifests::hdf5::Handle> owned_;
  hid_t file_;
  std::uint64_t file_bytes_;
};

}  // namespace q3d::loaders::formats
