// The journal: one checksummed JSON line for each finished unit. A unit without a line does not exist.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

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
// drops it and the next append cuts it off. A damaged line anywhere else is dropped too, and the next append
// first writes the file anew without it. Not thread-safe: there must be one writer only.
class Journal {
 public:
  // Loads the file if it exists; the first append creates it. Throws IoError.
  explicit Journal(std::filesystem::path file);

  // Returns the latest entry of a unit, if its input digest is `input_digest`. The caller must check whether
  // the unit's file is sound.
  std::optional<JournalEntry> find(std::int64_t unit, const std::string& input_digest) const;
  // Forgets a unit whose file turned out to be damaged. The journal's own file stays as it is.
  void forget(std::int64_t unit) { entries_.erase(unit); }
  // Appends an entry. Throws std::runtime_error that names the file (disk full, ...), and leaves the journal
  // as it was. Throws std::invalid_argument if entry.file leaves the journal's folder.
  void append(const JournalEntry& entry);
  const std::map<std::int64_t, JournalEntry>& entries() const { return entries_; }
  // Takes over an entry from another journal of the same folder. The file does not hold it before
  // write_anew().
  void adopt(const JournalEntry& entry) { entries_.insert_or_assign(entry.unit, entry); }
  // Writes the file atomically with one line for each entry, in the order of the units. Throws IoError.
  void write_anew();
  // True if loading dropped a torn last line. Its unit will be made again.
  bool dropped_torn_line() const { return dropped_torn_line_; }
  // Returns the line numbers, from 1, of the other lines that loading dropped because their checksum or their
  // fields do not match.
  const std::vector<std::int64_t>& damaged_lines() const { return damaged_lines_; }

 private:
  void repair();

  std::filesystem::path file_;
  std::map<std::int64_t, JournalEntry> entries_;
  std::uint64_t whole_bytes_ = 0;  // size up to the end of the last complete line
  std::uint64_t file_bytes_ = 0;   // size of the file, including a torn last line
  bool dropped_torn_line_ = false;
  std::vector<std::int64_t> damaged_lines_;
  std::optional<std::string> sound_lines_;  // the undamaged lines; set until repair() writes them
};

}  // namespace q3d::manifests
