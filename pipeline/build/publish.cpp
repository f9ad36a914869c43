#include "pipeline/build/publish.h"

#include <fmt/format.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "manifests/atomic_file.h"
#include "manifests/csv_formula.h"
#include "manifests/enumerators.h"
#include "manifests/file_descriptor.h"
#include "manifests/link_file.h"
#include "manifests/sealed_json.h"
#include "pipeline/dataset/verdict_rows.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/log.h"
#include "pipeline/stages/build_plan.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;

std::vector<dataset::ShardEntry> link_shards(const fs::path& folder, const candidates::Ingest& ingest,
                                             stages::StageStore& shards) {
  fs::create_directories(folder / "shards");
  manifests::remove_temporaries(folder);  // of a build that was killed while publishing
  manifests::remove_temporaries(folder / "shards");
  std::vector<dataset::ShardEntry> entries;
  for (const candidates::Unit& unit : ingest.units) {
    const auto entry = shards.entry(unit);
    if (!entry) throw std::runtime_error(fmt::format("unit {} has no finished shard", unit.index));
    const std::string name = fmt::format("shards/{:06}.h5", unit.index);
    manifests::link_or_copy(shards.file(unit), folder / name);
    entries.push_back({name, entry->sha256, entry->bytes, entry->rows, unit.index});
  }
  manifests::sync_folder(folder / "shards");
  return entries;
}

void check_sums(const candidates::Ingest& ingest, const dataset::Counts& counts,
                const std::vector<dataset::ShardEntry>& shards) {
  std::int64_t rows = 0;
  for (const dataset::ShardEntry& shard : shards) rows += shard.rows;
  const auto candidates = static_cast<std::int64_t>(ingest.candidates.size());
  if (counts.candidates != candidates ||
      counts.retained + counts.refined + counts.discarded + counts.failed != candidates ||
      counts.retained + counts.refined != rows) {
    throw std::runtime_error(
        fmt::format("the books do not balance: {} candidates, {} retained + {} refined + {} discarded + {} "
                    "failed, {} rows in shards",
                    candidates, counts.retained, counts.refined, counts.discarded, counts.failed, rows));
  }
}

int formula_cells(const candidates::Candidate& candidate, const manifests::Judgement& judgement) {
  const manifests::SampleRecord& record = candidate.record;
  int cells = 0;
  for (const std::string* cell :
       {&record.id, &record.dataset, &record.split, &record.source, &record.species, &judgement.detail}) {
    cells += manifests::looks_like_formula(*cell) ? 1 : 0;
  }
  return cells;
}

// Warns of cells that a spreadsheet could evaluate: names come from annotation files, and people may open
// verdicts.csv in a spreadsheet.
void warn_of_formulas(std::int64_t cells) {
  if (cells == 0) return;
  run::log_warning(fmt::format(
      "{} cells of verdicts.csv begin with =, +, - or @, so that a spreadsheet may run them as formulas; "
      "import the file with all columns as text",
      cells));
}

}  // namespace

fs::path version_folder(const fs::path& out, const config::BuildConfig& config,
                        const stages::StageKeys& keys) {
  return out / stages::version_name(config.name, keys);
}

void publish(const fs::path& folder, const dataset::DatasetInputs& inputs,
             const dataset::JudgementList& judgements, stages::StageStore& shards) {
  const candidates::Ingest& ingest = *inputs.ingest;
  const std::vector<dataset::ShardEntry> entries = link_shards(folder, ingest, shards);
  dataset::VerdictBooks books;
  std::int64_t formulas = 0;
  std::int64_t unit_of_row = -1;
  std::int64_t row = 0;
  manifests::AtomicWriter verdicts(folder / "verdicts.csv");
  verdicts.write(dataset::verdict_header());
  const auto add = [&](const auto& unit, const auto& candidate, const auto& judgement) {
    if (std::exchange(unit_of_row, unit.index) != unit.index) row = 0;
    verdicts.write(dataset::verdict_row(candidate, judgement, unit.index, row));
    row += manifests::is_kept(judgement.verdict) ? 1 : 0;
    formulas += formula_cells(candidate, judgement);
    books.add(candidate, judgement);
  };
  dataset::for_each_verdict(ingest, judgements, add);
  check_sums(ingest, books.counts(), entries);
  warn_of_formulas(formulas);
  const std::string verdicts_sha256 = verdicts.commit();
  const std::string document = dataset::dataset_json(inputs, books, entries, verdicts_sha256);
  manifests::write_file_atomically(folder / "dataset.json", document);
  manifests::sync_folder(folder.parent_path());
}

void point_latest(const fs::path& out, const fs::path& folder) {
  const fs::path temporary = out / "latest.tmp";
  fs::remove(temporary);
  fs::create_directory_symlink(folder.filename(), temporary);
  fs::rename(temporary, out / "latest");
  manifests::sync_folder(out);
}

}  // namespace q3d::pipeline::build
