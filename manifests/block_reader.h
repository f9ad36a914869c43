// Reads large files from their beginning to their end without holding them in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "manifests/reopened_file.h"

namespace q3d::manifests {

class BlockReader {
 public:
  // Opens a regular file. Throws IoError.
  explicit BlockReader(std::filesystem::path path) : file_(std::move(path)) {}

  std::uint64_t size() const { return file_.size(); }  // bytes of the whole file
  // Reads the next bytes of the file into `bytes` and returns how many they were. There are fewer than asked
  // for only at the end of the file. Throws as ReopenedFile::read_at does.
  std::size_t read(std::span<char> bytes);

 private:
  ReopenedFile file_;
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
