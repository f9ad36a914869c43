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

  std::uint64_t size() const { return stamp_.size; }  // bytes of the whole file
  // Reads the next bytes of the file into `bytes` and returns how many they were. There are fewer than asked
  // for only at the end of the file. If the server of a network disk has forgotten the open file (ESTALE),
  // the file is opened again. Throws IoError, also if the file was written or replaced in the meantime.
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

  // Returns the next line without its line feed, or nothing at the end of the file. The text is valid until
  // the next call. Throws IoError.
  std::optional<std::string_view> next();
  // Returns whether the line that next() returned last ended with a line feed.
  bool was_whole() const { return was_whole_; }

 private:
  BlockReader file_;
  std::string text_;  // text that was read; next() has returned it up to at_
  std::size_t at_ = 0;
  bool is_read_ = false;  // the whole file was read
  bool was_whole_ = true;
};

}  // namespace q3d::manifests
