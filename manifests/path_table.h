// Holds the paths of many files in little memory: the name of a folder is stored once for all of its files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace q3d::manifests {

// A set of paths, each of which has a number: 0, 1, 2, ... in the order in which they came. A path takes some
// 30 bytes in addition to its file's name. Paths are compared byte for byte. Not thread-safe.
class PathTable {
 public:
  // Returns the number of the path and whether it is new. Throws std::length_error beyond 2^32 - 1 paths.
  std::pair<std::uint32_t, bool> add(std::string_view path);
  std::optional<std::uint32_t> find(std::string_view path) const;
  std::string path(std::uint32_t number) const;
  std::uint32_t size() const { return static_cast<std::uint32_t>(entries_.size()); }

  // A path consists of the text of its folder, including the last '/', and a name. All paths of one folder
  // share this string.
  const std::string& folder(std::uint32_t number) const { return *folders_[entries_[number].folder]; }
  std::string_view name(std::uint32_t number) const;

  // All numbers in the order of their paths.
  std::vector<std::uint32_t> sorted() const;

 private:
  struct Entry {
    std::uint32_t folder = 0;
    std::uint32_t hash = 0;      // of the path
    std::uint64_t position = 0;  // of the name's length and text in blocks_
  };

  std::size_t slot_of(std::uint32_t hash, std::string_view path) const;
  std::uint64_t keep(std::string_view name);
  void grow();

  std::deque<Entry> entries_;
  std::vector<std::uint32_t> slots_;  // open addressing: number + 1, or 0 for an empty slot
  std::deque<std::string> blocks_;    // blocks of kBlock bytes, or of one longer name; names lie end to end
  std::unordered_map<std::string, std::uint32_t> folder_numbers_;
  std::vector<const std::string*> folders_;  // by number; they are the keys of folder_numbers_
};

}  // namespace q3d::manifests
