#include "pipeline/stages/stage_store.h"

#include <fmt/format.h>

#include <system_error>
#include <utility>

#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "pipeline/run/log.h"
#include "pipeline/stages/rank_journals.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::stages {
namespace {

std::filesystem::path opened(const std::filesystem::path& out, const std::string& stage,
                             const std::string& key, int rank) {
  std::filesystem::path folder = stage_folder(out, stage, key);
  if (rank == 0) open_stage_folder(folder, stage, key);
  return folder;
}

}  // namespace

std::filesystem::path unit_file(const std::filesystem::path& folder, std::int64_t unit) {
  return folder / fmt::format("unit-{:06}.h5", unit);
}

StageStore::StageStore(const std::filesystem::path& out, const std::string& stage, const std::string& key,
                       std::string candidates::Unit::*digest, RankOfStore rank)
    : folder_(opened(out, stage, key, rank.rank)),
      digest_(digest),
      rank_(std::move(rank)),
      journal_(folder_ / "journal.jsonl") {
  if (rank_.rank > 0) {
    own_journal_.emplace(rank_journal(folder_, rank_.run, rank_.rank));
    return;
  }
  for (const std::int64_t line : journal_.damaged_lines()) {
    run::log_warning(fmt::format(
        "{}, line {}: damaged (its checksum or its fields do not match); the unit it stood for is made again",
        (folder_ / "journal.jsonl").string(), line));
  }
  take_over(find_rank_journals(folder_));
}

void StageStore::take_over(const std::vector<std::filesystem::path>& files) {
  if (files.empty()) return;
  adopt_rank_journals(folder_, files, journal_);
  journal_.write_anew();
  for (const std::filesystem::path& file : files) std::filesystem::remove(file);
}

void StageStore::take_over_ranks() {
  // The journals are opened by name, because a network file system may not list new files yet.
  std::vector<std::filesystem::path> files;
  for (int rank = 1; rank < rank_.ranks; ++rank) {
    std::filesystem::path file = rank_journal(folder_, rank_.run, rank);
    if (std::filesystem::exists(file)) files.push_back(std::move(file));
  }
  const std::lock_guard lock(mutex_);
  for (const std::filesystem::path& file : files) {
    const manifests::Journal of_rank(file);
    for (const auto& [unit, entry] : of_rank.entries()) compared_.insert(unit);
  }
  take_over(files);
}

std::filesystem::path StageStore::file(const candidates::Unit& unit) const {
  return unit_file(folder_, unit.index);
}

// Returns the unit's journal entry, if its file exists with the right size.
std::optional<manifests::JournalEntry> StageStore::claimed(const candidates::Unit& unit) {
  std::optional<manifests::JournalEntry> entry;
  {
    const std::lock_guard lock(mutex_);
    entry = journal_.find(unit.index, unit.*digest_);
  }
  if (!entry) return std::nullopt;
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(file(unit), error);
  if (error && !manifests::names_no_file(error.value())) {
    throw manifests::IoError("inspect", file(unit), error.value());
  }
  if (!error && bytes == static_cast<std::uintmax_t>(entry->bytes)) return entry;
  give_up(unit, error ? fmt::format("it is gone ({})", error.message())
                      : fmt::format("got {} bytes, expected {}", bytes, entry->bytes));
  return std::nullopt;
}

std::optional<manifests::JournalEntry> StageStore::entry(const candidates::Unit& unit) {
  auto entry = claimed(unit);
  if (!entry) return std::nullopt;
  {
    const std::lock_guard lock(mutex_);
    if (compared_.contains(unit.index)) return entry;
  }
  if (!accept(unit, entry->sha256, manifests::sha256_file(file(unit)))) return std::nullopt;
  return entry;
}

std::optional<manifests::Table> StageStore::load(const candidates::Unit& unit) {
  const auto entry = claimed(unit);
  if (!entry) return std::nullopt;
  std::vector<std::byte> bytes = manifests::read_bytes(file(unit));
  if (!accept(unit, entry->sha256, manifests::sha256(bytes))) return std::nullopt;
  return manifests::read_table(file(unit), std::move(bytes));
}

bool StageStore::accept(const candidates::Unit& unit, const std::string& expected, const std::string& got) {
  if (got != expected) {
    give_up(unit, fmt::format("got SHA-256 {}, expected {}", got, expected));
    return false;
  }
  const std::lock_guard lock(mutex_);
  compared_.insert(unit.index);
  return true;
}

void StageStore::give_up(const candidates::Unit& unit, const std::string& why) {
  {
    const std::lock_guard lock(mutex_);
    journal_.forget(unit.index);
    compared_.erase(unit.index);
  }
  run::log_warning(
      fmt::format("{}: damaged: {}; unit {} is made again", file(unit).string(), why, unit.index));
}

std::optional<manifests::Table> StageStore::load_newest(std::int64_t unit) {
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
  if (own_journal_) {
    own_journal_->append(entry);
    journal_.adopt(entry);
  } else {
    journal_.append(entry);
  }
  compared_.insert(unit.index);
}

}  // namespace q3d::pipeline::stages
