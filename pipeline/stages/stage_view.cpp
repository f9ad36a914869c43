#include "pipeline/stages/stage_view.h"

#include <system_error>

#include "manifests/digest.h"
#include "pipeline/stages/rank_journals.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::stages {

StageView::StageView(const std::filesystem::path& out, const std::string& stage, const std::string& key)
    : folder_(stage_folder(out, stage, key)), journal_(folder_ / "journal.jsonl") {
  adopt_rank_journals(folder_, find_rank_journals(folder_), journal_);
}

bool StageView::exists() const {
  return std::filesystem::exists(manifest());
}

UnitState StageView::state(std::int64_t unit, const std::optional<std::string>& digest,
                           Comparison comparison) const {
  const auto found = journal_.entries().find(unit);
  if (found == journal_.entries().end()) return UnitState::absent;
  const manifests::JournalEntry& entry = found->second;
  if (digest && entry.input_digest != *digest) return UnitState::other_input;
  const std::filesystem::path file = unit_file(folder_, unit);
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(file, error);
  if (error || bytes != static_cast<std::uintmax_t>(entry.bytes)) return UnitState::damaged;
  const bool differs = comparison == Comparison::bytes && manifests::sha256_file(file) != entry.sha256;
  return differs ? UnitState::damaged : UnitState::finished;
}

}  // namespace q3d::pipeline::stages
