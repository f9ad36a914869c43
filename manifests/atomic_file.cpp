#include "manifests/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <random>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "manifests/file_descriptor.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;

class RemoveOnFailure {
 public:
  explicit RemoveOnFailure(const fs::path& path) : path_(path) {}
  ~RemoveOnFailure() {
    if (armed_) ::unlink(path_.c_str());
  }
  RemoveOnFailure(const RemoveOnFailure&) = delete;
  RemoveOnFailure& operator=(const RemoveOnFailure&) = delete;
  void disarm() { armed_ = false; }

 private:
  const fs::path& path_;
  bool armed_ = true;
};

// Syncs and closes a complete temporary file and renames it to `path`. If syncing the folder then fails, a
// guard may still try to remove the temporary file; it no longer exists, so this does no harm.
void finish(FileDescriptor& file, const fs::path& temporary, const fs::path& path) {
  file.sync();
  file.close();
  if (::rename(temporary.c_str(), path.c_str()) != 0) throw_errno("rename a finished file to", path);
  sync_folder(path.parent_path());
}

}  // namespace

fs::path temporary_name(const fs::path& path) {
  static std::atomic<unsigned> counter{0};
  static const unsigned machine = std::random_device{}();
  return path.parent_path() /
         fmt::format("{}.{}.{:08x}.{}.tmp", path.filename().string(), ::getpid(), machine, counter++);
}

void write_file_atomically(const fs::path& path, std::span<const std::byte> content) {
  const fs::path temporary = temporary_name(path);
  RemoveOnFailure guard(temporary);
  FileDescriptor file(temporary, O_WRONLY | O_CREAT | O_EXCL);
  file.write_all(content);
  finish(file, temporary, path);
  guard.disarm();
}

void write_file_atomically(const fs::path& path, std::string_view content) {
  write_file_atomically(path, std::as_bytes(std::span(content)));
}

AtomicWriter::AtomicWriter(fs::path path)
    : path_(std::move(path)),
      temporary_(temporary_name(path_)),
      file_(temporary_, O_WRONLY | O_CREAT | O_EXCL) {}

AtomicWriter::~AtomicWriter() {
  if (!is_committed_) ::unlink(temporary_.c_str());
}

void AtomicWriter::write(std::string_view text) {
  constexpr std::size_t kBlock = std::size_t{1} << 18U;
  pending_ += text;
  if (pending_.size() >= kBlock) flush();
}

void AtomicWriter::flush() {
  digest_.update(std::as_bytes(std::span(pending_)));
  file_.write_all(pending_);
  pending_.clear();
}

std::string AtomicWriter::commit() {
  flush();
  finish(file_, temporary_, path_);
  is_committed_ = true;
  return digest_.hex();
}

void commit_file(const fs::path& temporary, const fs::path& path) {
  RemoveOnFailure guard(temporary);
  FileDescriptor file(temporary, O_RDWR);
  finish(file, temporary, path);
  guard.disarm();
}

std::string read_file(const fs::path& path) {
  return read_input(path, [](const FileDescriptor& file) {
    std::string content(file.size(), '\0');
    file.read_at(0, std::as_writable_bytes(std::span(content)));
    return content;
  });
}

void sync_folder(const fs::path& folder) {
  FileDescriptor(folder.empty() ? fs::path(".") : folder, O_RDONLY | O_DIRECTORY).sync();
}

void remove_temporaries(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (entry->path().extension() == ".tmp" && entry->is_regular_file()) fs::remove(entry->path());
  }
  if (error) {
    throw std::runtime_error(fmt::format("cannot list {}: {}", folder.string(), error.message()));
  }
}

}  // namespace q3d::manifests
