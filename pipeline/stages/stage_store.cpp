#include "pipeline/stages/stage_store.h"

#include <fmt/format.h>

#include "pipeline/stages/stages.h"

namespace q3d::pipeline::stages {
namespace {

std::filesystem::path opened(const std::filesystem::path& out, const std::string& stage,
                             const std::string& key) {
  std::filesystem::path folder = stage_folder(out, stage, key);
  open_stage_folder(folder, stage, key);
  return folder;
}

}  // namespace

std::filesystem::path unit_file(const std::filesystem::path& folder, std::int64_t unit) {
  return folder / fmt::format("unit-{:06}.h5", unit);
}

StageStore::StageStore(const std::filesystem::path& out, const std::string& stage, const std::string& key,
                       std::string candidates::Unit::*digest)
    : folder_(opened(out, stage, key)), digest_(digest), journal_(folder_ / "journal.jsonl") {}

std::filesystem::path StageStore::file(const candidates::Unit& unit) const {
  return unit_file(folder_, unit.index);
}

std::optional<manifests::JournalEntry> StageStore::entry(const candidates::Unit& unit) const {
  const std::lock_guard lock(mutex_);
  return journal_.find(unit.index, unit.*digest_);
}

bool StageStore::has(const candidates::Unit& unit) const {
  return entry(unit).has_value();
}

std::optional<manifests::Table> StageStore::load(const candidates::Unit& unit) const {
  if (!has(unit)) return std::nullopt;
  return manifests::read_table(file(unit));
}

std::optional<manifests::Table> StageStore::load_newest(std::int64_t unit) const {
  candidates::Unit newest;
  newest.index = unit;
  {
    const std::lock_guard lock(mutex_);
    const auto found = journal_.entries().find(unit);
    if (found == journal_.entries().end()) return std::nullopt;
    newest.*digest_ = found->second.input_digest;
  }
  return load(newest);
}

void StageStore::save(const candidates::Unit& unit, const manifests::Table& table) {
  save(unit, table.rows,
       [&](const std::filesystem::path& path) { return manifests::write_table(path, table); });
}

void StageStore::save(const candidates::Unit& unit, std::int64_t rows,
                      const std::function<std::string(const std::filesystem::path&)>& write) {
  manifests::JournalEntry entry;
  entry.unit = unit.index;
  entry.input_digest = unit.*digest_;
  entry.file = file(unit).filename().string();
  entry.sha256 = write(file(unit));
  entry.bytes = static_cast<std::int64_t>(std::filesystem::file_size(file(unit)));
  entry.rows = rows;
  const std::lock_guard lock(mutex_);
  journal_.append(entry);
}

}  // namespace q3d::pipeline::stages
