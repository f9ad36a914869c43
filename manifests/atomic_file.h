// Writes files completely or not at all: under a temporary name, then fsync, rename, and fsync of the folder.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "manifests/digest.h"
#include "manifests/file_descriptor.h"

namespace q3d::manifests {

// Returns a name for a file that is to be called `path` once it is whole. It lies in the same folder, because
// rename works only within a file system. Process id and a counter keep two writers of one path apart, and a
// random number those on two machines. remove_temporaries() knows such names.
std::filesystem::path temporary_name(const std::filesystem::path& path);

// Writes `content` to `path`. If this fails, the temporary file is removed, an older file at `path` stays as
// it was, and IoError (manifests/file_descriptor.h) names the path and the reason (disk full, ...).
void write_file_atomically(const std::filesystem::path& path, std::span<const std::byte> content);
void write_file_atomically(const std::filesystem::path& path, std::string_view content);

// Writes a file like write_file_atomically(), but takes its text in pieces, for files that are too long to
// lie in memory.
class AtomicWriter {
 public:
  // Makes the temporary file. Throws IoError, as all members do.
  explicit AtomicWriter(std::filesystem::path path);
  // Removes the temporary file unless commit() has renamed it.
  ~AtomicWriter();
  AtomicWriter(const AtomicWriter&) = delete;
  AtomicWriter& operator=(const AtomicWriter&) = delete;

  void write(std::string_view text);
  // Makes the file durable and gives it its name. Returns the SHA-256 of its content. Call it once.
  std::string commit();

 private:
  void flush();

  std::filesystem::path path_;
  std::filesystem::path temporary_;
  FileDescriptor file_;
  std::string pending_;
  Sha256 digest_;
  bool is_committed_ = false;
};

// Makes a finished temporary file durable and renames it to `path`. If this fails, the temporary file is
// removed.
void commit_file(const std::filesystem::path& temporary, const std::filesystem::path& path);

// The whole content of a regular file. Throws IoError.
std::string read_file(const std::filesystem::path& path);

// Calls fsync on a folder, which makes the names in it durable. Throws std::runtime_error.
void sync_folder(const std::filesystem::path& folder);

// Removes the files that a killed run left behind: those named *.tmp in `folder` (not recursive).
void remove_temporaries(const std::filesystem::path& folder);

}  // namespace q3d::manifests
