#include "manifests/spill_file.h"

#include <fcntl.h>
#include <unistd.h>

#include "manifests/atomic_file.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;

// Opens a file without a name. Not every file system supports that; elsewhere the name is removed at once. If
// the process is killed in between, the file stays, and remove_temporaries() removes it by its suffix.
FileDescriptor nameless(const fs::path& folder) {
  try {
    return {folder.empty() ? fs::path(".") : folder, O_TMPFILE | O_RDWR};
  } catch (const IoError& error) {
    if (error.code() != EOPNOTSUPP && error.code() != EISDIR && error.code() != EINVAL) throw;
  }
  const fs::path name = temporary_name(folder / "spill");
  FileDescriptor file(name, O_RDWR | O_CREAT | O_EXCL);
  if (::unlink(name.c_str()) != 0) throw_errno("remove", name);
  return file;
}

}  // namespace

SpillFile::SpillFile(const fs::path& folder) : file_(nameless(folder)) {}

std::uint64_t SpillFile::append(std::span<const std::byte> bytes) {
  const std::uint64_t offset = size_;
  file_.write_all(bytes);
  size_ += bytes.size();
  return offset;
}

}  // namespace q3d::manifests
