// Reads a stage's folder without changing it, for `status` and `build --dry-run`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "manifests/journal.h"

namespace q3d::pipeline::stages {

enum class UnitState : std::uint8_t {
  finished,
  absent,       // the journal does not name the unit
  other_input,  // it was made from other pictures or labels
  damaged,      // its file is gone, or is not the one that the journal names
};

// Says whether a unit's file is compared with the journal by its size or by its bytes.
enum class Comparison : std::uint8_t { sizes, bytes };

class StageView {
 public:
  // A view of <out>/stages/<stage>-<key>/, which need not exist. Throws manifests::IoError.
  StageView(const std::filesystem::path& out, const std::string& stage, const std::string& key);

  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path manifest() const { return folder_ / "manifest.json"; }
  bool exists() const;

  // Returns the state of a unit. Without a digest, the unit may have been made from any input. With
  // Comparison::bytes the whole file is read, and manifests::IoError is thrown if it exists and cannot be
  // read.
  UnitState state(std::int64_t unit, const std::optional<std::string>& digest, Comparison comparison) const;

  const manifests::Journal& journal() const { return journal_; }

 private:
  std::filesystem::path folder_;
  manifests::Journal journal_;
};

}  // namespace q3d::pipeline::stages
