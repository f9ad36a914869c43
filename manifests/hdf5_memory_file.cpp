// This uses HDF5's in-memory driver with memory functions of our own, which keep the image when the file
// closes. The library's H5Fget_file_image would be shorter, but in 1.10 it clears a flag of the superblock
// without renewing its checksum, and no reader accepts the result.
#include "manifests/hdf5_memory_file.h"

#include <fmt/format.h>

#include <bit>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace q3d::manifests::hdf5 {
namespace {

static_assert(std::endian::native == std::endian::little, "tables are written from little-endian memory");

// HDF5 first checks whether the name exists on disk. A name below /dev/null never does.
constexpr const char* kNameOfNoFile = "/dev/null/table";
constexpr std::string_view kSignature = "\x89HDF\r\n\x1a\n";
constexpr std::size_t kGrowthBytes = 1 << 20;
constexpr std::size_t kEndOfFileField = 28;  // HDF5 file format, superblock version 2 "End of File Address"

}  // namespace

MemoryFile::Memory::~Memory() {
  std::free(bytes);
}

H5FD_file_image_callbacks_t MemoryFile::callbacks(Memory* memory) {
  H5FD_file_image_callbacks_t calls{};
  calls.image_malloc = [](std::size_t size, H5FD_file_image_op_t, void*) { return std::malloc(size); };
  calls.image_memcpy = [](void* to, const void* from, std::size_t size, H5FD_file_image_op_t, void*) {
    return std::memcpy(to, from, size);
  };
  calls.image_realloc = [](void* old, std::size_t size, H5FD_file_image_op_t, void* user) -> void* {
    void* grown = std::realloc(old, size);
    auto& kept = *static_cast<Memory*>(user);
    if (grown != nullptr) {
      kept.bytes = static_cast<std::byte*>(grown);
      kept.allocated = size;
    }
    return grown;
  };
  // Memory keeps the image, which is the driver's only buffer.
  calls.image_free = [](void*, H5FD_file_image_op_t, void*) -> herr_t { return 0; };
  calls.udata_copy = [](void* user) { return user; };
  calls.udata_free = [](void*) -> herr_t { return 0; };
  calls.udata = memory;
  return calls;
}

MemoryFile::MemoryFile() : memory_(std::make_unique<Memory>()) {
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "file access properties");
  check(H5Pset_fapl_core(access.get(), kGrowthBytes, false), "in-memory driver");
  H5FD_file_image_callbacks_t calls = callbacks(memory_.get());
  check(H5Pset_file_image_callbacks(access.get(), &calls), "in-memory driver");
  // Without a sieve buffer, the library copies values straight into the image.
  check(H5Pset_sieve_buf_size(access.get(), 0), "in-memory driver");
  check(H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_V18), "library version bounds");
  const Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose, "file creation properties");
  check(H5Pset_obj_track_times(creation.get(), false), "file creation properties");
  file_.emplace(H5Fcreate(kNameOfNoFile, H5F_ACC_TRUNC, creation.get(), access.get()), H5Fclose,
                "in-memory file");
}

void MemoryFile::attribute(const std::string& name, hid_t type, const void* value) {
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose, name);
  const Handle attribute(H5Acreate2(file_->get(), name.c_str(), type, space.get(), H5P_DEFAULT, H5P_DEFAULT),
                         H5Aclose, name);
  check(H5Awrite(attribute.get(), type, value), name);
}

Handle MemoryFile::empty_dataset(const std::string& name, hid_t type, const std::vector<hsize_t>& extents) {
  const Handle space(H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr), H5Sclose,
                     name);
  const Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, name);
  check(H5Pset_layout(creation.get(), H5D_CONTIGUOUS), name);
  check(H5Pset_obj_track_times(creation.get(), false), name);
  return {H5Dcreate2(file_->get(), name.c_str(), type, space.get(), H5P_DEFAULT, creation.get(), H5P_DEFAULT),
          H5Dclose, name};
}

void MemoryFile::dataset(const std::string& name, hid_t type, const std::vector<hsize_t>& extents,
                         const void* data) {
  const Handle dataset = empty_dataset(name, type, extents);
  check(H5Dwrite(dataset.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data), name);
}

void MemoryFile::bytes(const std::string& name, std::span<const std::span<const std::byte>> rows) {
  hsize_t total = 0;
  for (const auto& row : rows) total += row.size();
  const Handle dataset = empty_dataset(name, H5T_STD_U8LE, {total});
  if (total == 0) return;
  const Handle in_file(H5Dget_space(dataset.get()), H5Sclose, name);
  hsize_t start = 0;
  for (const auto& row : rows) {
    const hsize_t count = row.size();
    if (count == 0) continue;
    check(H5Sselect_hyperslab(in_file.get(), H5S_SELECT_SET, &start, nullptr, &count, nullptr), name);
    const Handle in_memory(H5Screate_simple(1, &count, nullptr), H5Sclose, name);
    check(H5Dwrite(dataset.get(), H5T_STD_U8LE, in_memory.get(), in_file.get(), H5P_DEFAULT, row.data()),
          name);
    start += count;
  }
}

FileImage MemoryFile::finish() {
  file_->close("in-memory file");
  std::uint64_t end_of_file = 0;
  if (memory_->allocated >= kEndOfFileField + sizeof(end_of_file)) {
    std::memcpy(&end_of_file, memory_->bytes + kEndOfFileField, sizeof(end_of_file));
  }
  if (end_of_file == 0 || end_of_file > memory_->allocated) {
    throw std::runtime_error(fmt::format("the HDF5 library left a file of {} bytes in memory for {}",
                                         end_of_file, memory_->allocated));
  }
  return {std::exchange(memory_->bytes, nullptr), end_of_file};
}

Handle open_image(std::span<const std::byte> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.starts_with(kSignature)) throw std::runtime_error("not an HDF5 file");
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "file access properties");
  check(H5Pset_fapl_core(access.get(), kGrowthBytes, false), "in-memory driver");
  auto* image = const_cast<std::byte*>(bytes.data());  // the library copies it and changes nothing
  check(H5Pset_file_image(access.get(), image, bytes.size()), "in-memory driver");
  return {H5Fopen(kNameOfNoFile, H5F_ACC_RDONLY, access.get()), H5Fclose, "cannot open"};
}

}  // namespace q3d::manifests::hdf5
