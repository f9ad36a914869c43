#include "manifests/reopened_file.h"

#include <cerrno>
#include <utility>

namespace q3d::manifests {

ReopenedFile::ReopenedFile(std::filesystem::path path)
    : path_(std::move(path)),
      file_(std::make_shared<const FileDescriptor>(open_input(path_))),
      stamp_(stamp_of(*file_)) {}

std::shared_ptr<const FileDescriptor> ReopenedFile::file() const {
  const std::lock_guard lock(mutex_);
  return file_;
}

void ReopenedFile::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  for (int attempt = 0;; ++attempt) {
    const std::shared_ptr<const FileDescriptor> file = this->file();
    try {
      file->read_at(offset, bytes);
      return;
    } catch (const IoError& error) {
      if (error.code() != ESTALE || !pause_before_retry(ESTALE, attempt)) throw;
    }
    open_again(file);
  }
}

// Opens the file again, unless another thread has done so since the caller got the forgotten one.
void ReopenedFile::open_again(const std::shared_ptr<const FileDescriptor>& forgotten) const {
  const std::lock_guard lock(mutex_);
  if (file_ != forgotten) return;
  auto again = std::make_shared<const FileDescriptor>(open_input(path_));
  if (stamp_of(*again) != stamp_) {
    throw IoError("read", path_, "it has changed while it was read: run again", ESTALE);
  }
  file_ = std::move(again);
}

}  // namespace q3d::manifests
