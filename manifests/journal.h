// The journal: one checksummed JSON line for each finished unit. A unit without a line does not exist.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace q3d::manifests {

struct JournalEntry {
  std::int64_t unit = 0;
  std::string input_digest;  // digest of the unit's inputs; a line with another digest is stale
  std::string file;          // name within the journal's folder; empty when the unit left no file
  std::string sha256;
  std::int64_t bytes = 0;
  std::int64_t rows = 0;
};

// An append is fsynced before it returns. If the last line is torn because its writer was killed, loading
// drops it and the next append cuts it off. A damaged line anywhere else throws std::runtime_error. Not
// thread-safe: there must be one writer only.
class Journal {
 public:
  // Loads the file if it exists; the first append creates it. Throws std::runtime_error that names file and
  // line.
  explicit Journal(std::filesystem::path file);

  // The latest entry of a unit, if its input digest is `input_digest` and its file is there with the right
  // size.
  std::optional<JournalEntry> find(std::int64_t unit, const std::string& input_digest) const;
  // Appends an entry. Throws std::runtime_error that names the file (disk full, ...), and leaves the journal
  // as it was. Throws std::invalid_argument if entry.file leaves the journal's folder.
  void append(const JournalEntry& entry);
  const std::map<std::int64_t, JournalEntry>& entries() const { return entries_; }
  // True if loading dropped a torn last line. Its unit will be made again.
  bool dropped_torn_line() const { return dropped_torn_line_; }

 private:
  std::filesystem::path file_;
  std::map<std::int64_t, JournalEntry> entries_;
  std::uint64_t whole_bytes_ = 0;  // size up to the end of the last complete line
  std::uint64_t file_bytes_ = 0;   // size of the file, including a torn last line
  bool dropped_torn_line_ = false;
};

}  // namespace q3d::manifests
