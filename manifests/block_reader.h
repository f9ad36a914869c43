// Reads large files from their beginning to their end without holding them in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "manifests/file_descriptor.h"
#include "manifests/file_stamp.h"

namespace q3d::manifests {

class BlockReader {
 public:
  // Opens a regular file. Throws IoError.
  explicit BlockReader(std::filesystem::path path);

  std::uint64_t size() const { return stamp_.size; }  // of the whole file
  // Fills `bytes` with what follows, and returns how many there were: fewer only at the end. If the server of
  // a network disk has forgotten the open file (ESTALE), the file is opened again. Throws IoError, also if
  // the file was written or replaced by then.
  std::size_t read(std::span<char> bytes);

 private:
  std::filesystem::path path_;
  FileDescriptor file_;
  FileStamp stamp_;
  std::uint64_t at_ = 0;
};

class LineReader {
 public:
  explicit LineReader(std::filesystem::path path) : file_(std::move(path)) {}

  // The next line, without its line feed; nothing at the end. The text holds until the next call. Throws
  // IoError.
  std::optional<std::string_view> next();
  // Whether the line that next() gave last ended with a line feed.
  bool was_whole() const { return was_whole_; }

 private:
  BlockReader file_;
  std::string text_;  // that was read and not given yet, from at_ on
  std::size_t at_ = 0;
  bool is_read_ = false;  // all of the file is
  bool was_whole_ = true;
};

}  // namespace q3d::manifests
