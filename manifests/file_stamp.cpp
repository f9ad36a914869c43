#include "manifests/file_stamp.h"

#include <sys/stat.h>

namespace q3d::manifests {
namespace {

std::int64_t ns_of(const timespec& time) {
  return time.tv_sec * kNsPerSecond + time.tv_nsec;
}

FileStamp stamp_in(const struct stat& status) {
  return {static_cast<std::uint64_t>(status.st_size), ns_of(status.st_mtim), ns_of(status.st_ctim),
          status.st_ino, status.st_dev};
}

}  // namespace

std::optional<FileStamp> stamp_of(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return stamp_in(status);
}

FileStamp stamp_of(const FileDescriptor& file) {
  struct stat status {};
  if (::fstat(file.get(), &status) != 0) throw_errno("look at", file.path());
  return stamp_in(status);
}

}  // namespace q3d::manifests
