// HDF5 files in memory: one that is written there until it is complete, and one whose bytes were read
// already.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/hdf5.h"

namespace q3d::manifests::hdf5 {

// Use it only while a Session exists. Equal calls give equal bytes, because the file has no times and its
// library-version bounds are fixed. All members throw std::runtime_error that names the attribute or dataset.
class MemoryFile {
 public:
  MemoryFile();

  // Adds a scalar attribute to the root group.
  void attribute(const std::string& name, hid_t type, const void* value);
  // Adds a complete, contiguous dataset.
  void dataset(const std::string& name, hid_t type, const std::vector<hsize_t>& extents, const void* data);
  // Closes the file and returns its bytes. Call once, at the end.
  std::vector<std::byte> finish();

 private:
  struct Memory {
    std::byte* bytes = nullptr;
    std::size_t allocated = 0;
    ~Memory();
  };
  static H5FD_file_image_callbacks_t callbacks(Memory* memory);

  std::unique_ptr<Memory> memory_;
  std::optional<Handle> file_;
};

// Opens the bytes of a whole HDF5 file for reading; the library makes its own copy. Use it while a Session
// lives. Throws std::runtime_error.
Handle open_image(std::span<const std::byte> bytes);

}  // namespace q3d::manifests::hdf5
