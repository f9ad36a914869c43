// The folder of one stage, with its units' files and the journal that says which units are finished.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "manifests/journal.h"
#include "manifests/table.h"
#include "pipeline/candidates/ingest.h"

namespace q3d::pipeline::stages {

// Returns the path of a unit's file in a stage's folder.
std::filesystem::path unit_file(const std::filesystem::path& folder, std::int64_t unit);

// Identifies a rank's own journals if several ranks share a build.
struct RankOfStore {
  std::string run;  // id of this run, the same for all its ranks; empty in a run of one process
  int rank = 0;
  int ranks = 1;
};

// A file of an earlier run is used only after its bytes were compared with the journal's SHA-256. A unit
// whose file is gone or damaged counts as not finished, and a warning names it. Thread-safe: one thread may
// save units while others ask for them.
class StageStore {
 public:
  // Opens or makes <out>/stages/<stage>-<key>/, and takes over the lines that ranks of a killed run have left
  // in their own journals. Only rank 0 does so; the other ranks must open the store after it, and keep their
  // lines in a journal of their own. `digest` is the digest of a unit on which its file depends. Throws as
  // open_stage_folder does, and manifests::IoError.
  StageStore(const std::filesystem::path& out, const std::string& stage, const std::string& key,
             std::string candidates::Unit::*digest = &candidates::Unit::input_digest, RankOfStore rank = {});

  // Returns whether the unit is finished. The first call of a run reads the unit's file whole. Throws
  // manifests::IoError if an existing file cannot be read; so do the next two functions.
  bool has(const candidates::Unit& unit) { return entry(unit).has_value(); }
  std::optional<manifests::JournalEntry> entry(const candidates::Unit& unit);
  // Returns the table of a finished unit, parsed from the very bytes that were compared.
  std::optional<manifests::Table> load(const candidates::Unit& unit);

  // Returns the newest table of a unit, whatever its input was, for readers that do not know the candidates.
  // The caller must check that the table has the expected candidates.
  std::optional<manifests::Table> load_newest(std::int64_t unit);
  void save(const candidates::Unit& unit, const manifests::Table& table);
  // Saves a unit. `write` makes the file at the given path and returns its SHA-256, which the journal
  // records.
  void save(const candidates::Unit& unit, std::int64_t rows,
            const std::function<std::string(const std::filesystem::path&)>& write);

  std::filesystem::path file(const candidates::Unit& unit) const;

  // Moves the lines of the other ranks into journal.jsonl. Rank 0 calls it when they have ended their work.
  // The files that they made in this run are not read again.
  void take_over_ranks();

 private:
  std::optional<manifests::JournalEntry> claimed(const candidates::Unit& unit);
  bool accept(const candidates::Unit& unit, const std::string& expected, const std::string& got);
  void give_up(const candidates::Unit& unit, const std::string& why);
  void take_over(const std::vector<std::filesystem::path>& files);

  std::filesystem::path folder_;
  std::string candidates::Unit::*digest_;
  RankOfStore rank_;
  std::mutex mutex_;  // guards the members below
  manifests::Journal journal_;
  std::optional<manifests::Journal> own_journal_;  // the journal of a rank other than 0
  std::set<std::int64_t> compared_;                // units whose file this run has compared or written
};

}  // namespace q3d::pipeline::stages
