#include "pipeline/build/repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/link_file.h"
#include "manifests/lock.h"
#include "manifests/sealed_json.h"
#include "pipeline/build/build.h"
#include "pipeline/dataset/verify.h"
#include "pipeline/run/errors.h"
#include "pipeline/stages/stage_check.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;
using dataset::Damage;

struct Findings {
  std::vector<std::string> problems;
  std::vector<Damage> damage;
  bool has_manifest = true;  // dataset.json is undamaged
};

// Finds the problems of a dataset and its stages. Without a sound dataset.json the other files cannot be
// checked; the build that follows checks them.
Findings find_problems(const fs::path& folder, bool quiet) {
  try {
    dataset::VerifySummary summary = dataset::verify(folder, quiet, /*with_stages=*/true);
    return {std::move(summary.problems), std::move(summary.damage), true};
  } catch (const manifests::DamagedDocument& error) {
    Findings findings{{error.what()}, {{folder / "dataset.json", ""}}, false};
    for (const stages::StageProblem& found : stages::check_stages(folder.parent_path()).problems) {
      findings.problems.push_back(found.file.string() + ": " + found.text);
      findings.damage.push_back({found.file, found.expected});
    }
    return findings;
  }
}

// Removes the temporary files that a killed repair may have left in a dataset.
void remove_leftovers(const fs::path& folder) {
  for (const fs::path& place : {folder, folder / "shards"}) {
    if (fs::is_directory(place)) manifests::remove_temporaries(place);
  }
}

// Moves a file to <out>/quarantine. Returns its new path, or nothing if the file is gone.
std::optional<fs::path> quarantine(const fs::path& out, const fs::path& file) {
  if (!fs::exists(fs::symlink_status(file))) return std::nullopt;
  const fs::path wanted = out / "quarantine" / file.lexically_relative(out);
  fs::path place = wanted;
  for (int i = 1; fs::exists(place); ++i) place = wanted.string() + "." + std::to_string(i);
  fs::create_directories(place.parent_path());
  fs::rename(file, place);
  manifests::sync_folder(place.parent_path());
  manifests::sync_folder(file.parent_path());
  return place;
}

// Copies a damaged journal to the quarantine. The original stays, because a build needs its undamaged lines
// and rewrites the file itself.
std::optional<fs::path> quarantine_copy(const fs::path& out, const fs::path& file) {
  const std::string content = manifests::read_file(file);
  const auto place = quarantine(out, file);
  manifests::write_file_atomically(file, content);
  return place;
}

// Returns all shards in the output folder: those of the stages and those of its datasets.
std::vector<fs::path> all_shards(const fs::path& out) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(out)) {
    const bool is_quarantined = *entry.path().lexically_relative(out).begin() == "quarantine";
    if (entry.path().extension() == ".h5" && entry.is_regular_file() && !is_quarantined) {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

// Links every missing file that has a copy.
std::vector<fs::path> mend_from_copies(const fs::path& out, const std::vector<Damage>& damage) {
  std::vector<fs::path> mended;
  const bool wants_any = std::any_of(damage.begin(), damage.end(),
                                     [](const Damage& each) { return each.file.extension() == ".h5"; });
  if (!wants_any) return mended;
  std::map<std::string, fs::path> copies;  // by digest
  for (const fs::path& file : all_shards(out)) copies.emplace(manifests::sha256_file(file), file);
  for (const Damage& each : damage) {
    const auto copy = copies.find(each.expected);
    if (copy == copies.end() || fs::exists(each.file)) continue;
    fs::create_directories(each.file.parent_path());
    manifests::link_or_copy(copy->second, each.file);
    manifests::sync_folder(each.file.parent_path());
    mended.push_back(each.file);
  }
  return mended;
}

void require_same_config(const fs::path& folder, const config::BuildConfig& config) {
  const nlohmann::json built = dataset::read_dataset_document(folder).at("provenance").at("config");
  if (built == nlohmann::json(config.as_written)) return;
  throw run::ConfigError(fmt::format(
      "{}: was built with another config than the one that is given; give all --config files and --set "
      "keys of that build, in the same order (provenance.config in its dataset.json holds them)",
      folder.string()));
}

// Runs all units through the stages again, where only missing files are made.
void build_again(const fs::path& folder, const config::BuildConfig& config, run::RunOptions options,
                 const std::optional<std::string>& document, RepairSummary& summary) {
  options.out = folder.parent_path();
  options.rebuild = true;
  const BuildSummary built = build(config, options);
  summary.was_built = true;
  if (!fs::equivalent(built.folder, folder)) {
    summary.unrepaired.push_back(fmt::format(
        "the config and its pictures now give another dataset, {}, because one of them has changed since",
        built.folder.string()));
    return;
  }
  if (!document || manifests::read_file(folder / "dataset.json") == *document) return;
  manifests::write_file_atomically(folder / "dataset.json", *document);
  summary.unrepaired.emplace_back(
      "dataset.json: the build gives other labels or verdicts than before, so the earlier file was put back");
}

}  // namespace

RepairSummary repair(const fs::path& given, const std::optional<config::BuildConfig>& config,
                     const run::RunOptions& options) {
  RepairSummary summary;
  summary.folder = fs::canonical(dataset::dataset_folder(given));
  const fs::path out = summary.folder.parent_path();
  Findings before;
  std::optional<std::string> document;
  {
    // A build that works meanwhile would have files that are not in its journal yet, which look damaged.
    const manifests::FolderLock lock(out);
    remove_leftovers(summary.folder);
    before = find_problems(summary.folder, options.quiet);
    summary.problems = before.problems;
    if (before.problems.empty()) return summary;
    if (before.has_manifest) {
      if (config) require_same_config(summary.folder, *config);
      document = manifests::read_file(summary.folder / "dataset.json");
    }
    for (const Damage& each : before.damage) {
      const bool is_journal = each.file.filename() == "journal.jsonl";
      if (const auto place = is_journal ? quarantine_copy(out, each.file) : quarantine(out, each.file)) {
        summary.quarantined.push_back(*place);
      }
    }
    summary.copied = mend_from_copies(out, before.damage);
  }
  if (config && summary.copied.size() < before.damage.size()) {
    build_again(summary.folder, *config, options, document, summary);
  }
  const bool has_manifest = fs::exists(summary.folder / "dataset.json");
  const Findings after = has_manifest
                             ? find_problems(summary.folder, options.quiet)
                             : Findings{{"dataset.json: it was damaged and is in the quarantine"}, {}, false};
  summary.unrepaired.insert(summary.unrepaired.end(), after.problems.begin(), after.problems.end());
  return summary;
}

}  // namespace q3d::pipeline::build
