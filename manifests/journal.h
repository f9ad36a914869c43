// The journal: one checksummed JSON line for each finished unit. What has no line does not exist.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace q3d::manifests {

struct JournalEntry {
  std::int64_t unit = 0;
  std::string input_digest;  // what the unit was made from; a line with another digest is stale
  std::string file;          // name within the journal's folder; empty when the unit left no file
  std::string sha256;
  std::int64_t bytes = 0;
  std::int64_t rows = 0;
};

// Appends are fsynced before they return. A torn last line (killed writer) is dropped on load and cut off
// before the next append; a damaged line anywhere else throws std::runtime_error. Not thread-safe: one
// writer.
class Journal {
 public:
  // Loads the file if it is there; the first append makes it. Throws std::runtime_error naming file and line.
  explicit Journal(std::filesystem::path file);

  // The latest entry of a unit, if its input digest is `input_digest` and its file is there with the right
  // size.
  std::optional<JournalEntry> find(std::int64_t unit, const std::string& input_digest) const;
  // Throws std::runtime_error naming the file (disk full, ...), after which the journal is as it was before,
  // and std::invalid_argument when entry.file leaves the journal's folder.
  void append(const JournalEntry& entry);
  const std::map<std::int64_t, JournalEntry>& entries() const { return entries_; }
  // True when loading dropped a torn last line: its unit will be made again.
  bool dropped_torn_line() const { return dropped_torn_line_; }

 private:
  std::filesystem::path file_;
  std::map<std::int64_t, JournalEntry> entries_;
  std::uint64_t whole_bytes_ = 0;  // up to the end of the last whole line
  std::uint64_t file_bytes_ = 0;   // the file's size, a torn last line included
  bool dropped_torn_line_ = false;
};

}  // namespace q3d::manifests
