// Writes HDF5 files in memory, and opens HDF5 files whose bytes are already in memory.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "manifests/hdf5.h"

namespace q3d::manifests::hdf5 {

// The bytes of a complete HDF5 file.
class FileImage {
 public:
  // Takes memory that std::malloc returned; the file is its first `size` bytes.
  FileImage(std::byte* memory, std::size_t size) : memory_(memory), size_(size) {}
  std::span<const std::byte> bytes() const { return {memory_.get(), size_}; }

 private:
  struct Free {
    void operator()(std::byte* memory) const { std::free(memory); }
  };
  std::unique_ptr<std::byte[], Free> memory_;
  std::size_t size_ = 0;
};

// Composes an HDF5 file in memory. Use it only while a Session exists. Equal calls give equal bytes, because
// the file has no times and its library-version bounds are fixed. All members throw std::runtime_error that
// names the attribute or dataset.
class MemoryFile {
 public:
  MemoryFile();

  // Adds a scalar attribute to the root group.
  void attribute(const std::string& name, hid_t type, const void* value);
  // Adds a complete, contiguous dataset.
  void dataset(const std::string& name, hid_t type, const std::vector<hsize_t>& extents, const void* data);
  // Adds a contiguous dataset of uint8 that holds the rows end to end. Each row is copied once, into the
  // file.
  void bytes(const std::string& name, std::span<const std::span<const std::byte>> rows);
  // Closes the file and returns its bytes, which are not copied. Call once, at the end.
  FileImage finish();

 private:
  struct Memory {
    std::byte* bytes = nullptr;
    std::size_t allocated = 0;
    Memory() = default;
    ~Memory();
    Memory(const Memory&) = delete;
    Memory& operator=(const Memory&) = delete;
  };
  static H5FD_file_image_callbacks_t callbacks(Memory* memory);
  // Makes a contiguous dataset whose values are still to be written.
  Handle empty_dataset(const std::string& name, hid_t type, const std::vector<hsize_t>& extents);

  std::unique_ptr<Memory> memory_;
  std::optional<Handle> file_;
};

// Opens the bytes of a whole HDF5 file for reading; the library makes its own copy. Use it while a Session
// lives. Throws std::runtime_error.
Handle open_image(std::span<const std::byte> bytes);

}  // namespace q3d::manifests::hdf5
