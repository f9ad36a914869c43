#include "manifests/durability.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

#include "manifests/file_descriptor.h"

namespace q3d::manifests {
namespace {

std::atomic<bool> syncs{true};
std::atomic<bool> locks{true};

}  // namespace

void set_durability(Durability wanted) {
  syncs = wanted.syncs;
  locks = wanted.locks;
}

Durability durability() {
  return {syncs, locks};
}

void sync_file_system(const std::filesystem::path& folder) {
  if (!syncs) return;
  const FileDescriptor file(folder, O_RDONLY | O_DIRECTORY);
  while (::syncfs(file.get()) != 0) {
    if (errno != EINTR) throw_errno("sync the file system of", folder);
  }
}

}  // namespace q3d::manifests
