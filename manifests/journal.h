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
  std::string file;          // name within the stage's folder
  std::string sha256;
  std::int64_t bytes = 0;
  std::int64_t rows = 0;
};

// Appends are fsynced before they return. A torn last line (killed writer) is dropped on load, a damaged line
// anywhere else throws std::runtime_error. Not thread-safe: one writer.
class Journal {
 public:
  explicit Journal(std::filesystem::path file);

  // The latest entry of a unit, if its input digest is `input_digest` and its file is there with the right
  // size.
  std::optional<JournalEntry> find(std::int64_t unit, const std::string& input_digest) const;
  void append(const JournalEntry& entry);
  const std::map<std::int64_t, JournalEntry>& entries() const { return entries_; }

 private:
  std::filesystem::path file_;
  std::map<std::int64_t, JournalEntry> entries_;
};

}  // namespace q3d::manifests
