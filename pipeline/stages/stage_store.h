// One stage's folder: unit files and the journal that says which of them exist.
#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "manifests/journal.h"
#include "manifests/table.h"
#include "pipeline/candidates/ingest.h"

namespace q3d::pipeline::stages {

// A unit's file in a stage's folder.
std::filesystem::path unit_file(const std::filesystem::path& folder, std::int64_t unit);

// Thread-safe: one thread may save units while another asks for them.
class StageStore {
 public:
  // Opens or makes <out>/stages/<stage>-<key>/. `digest` is what of a unit its file depends on.
  StageStore(const std::filesystem::path& out, const std::string& stage, const std::string& key,
             std::string candidates::Unit::*digest = &candidates::Unit::input_digest);

  bool has(const candidates::Unit& unit) const;
  std::optional<manifests::Table> load(
      const candidates::Unit& unit) const;  // throws std::runtime_error on a damaged file
  // The newest table of a unit, whatever its input was, for readers that do not know the candidates. The
  // caller must check that the table is of the candidates that it expects.
  std::optional<manifests::Table> load_newest(std::int64_t unit) const;
  void save(const candidates::Unit& unit, const manifests::Table& table);
  // Records a file that `write` makes under the given path and whose SHA-256 it returns.
  void save(const candidates::Unit& unit, std::int64_t rows,
            const std::function<std::string(const std::filesystem::path&)>& write);

  std::filesystem::path file(const candidates::Unit& unit) const;
  std::optional<manifests::JournalEntry> entry(const candidates::Unit& unit) const;

 private:
  std::filesystem::path folder_;
  std::string candidates::Unit::*digest_;
  mutable std::mutex mutex_;  // guards journal_
  manifests::Journal journal_;
};

}  // namespace q3d::pipeline::stages
