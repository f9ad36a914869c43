#include "pipeline/stages/stage_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "manifests/journal.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::stages {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> stage_folders(const fs::path& out) {
  std::vector<fs::path> folders;
  if (!fs::is_directory(out / "stages")) return folders;
  for (const auto& entry : fs::directory_iterator(out / "stages")) {
    if (entry.is_directory() && entry.path() != plans_folder(out)) folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

void check_manifest(const fs::path& folder, StageCheck& check) {
  const fs::path file = folder / "manifest.json";
  const std::string name = folder.filename().string();
  const std::string short_key = name.substr(name.rfind('-') + 1);
  const auto key = fs::exists(file) ? key_in_manifest(file) : std::nullopt;
  if (key && key->starts_with(short_key)) return;
  check.problems.push_back({file,
                            fmt::format("got {}, expected a key that starts with {}",
                                        key ? "the key " + *key : "no readable key", short_key),
                            ""});
}

void check_units(const fs::path& folder, StageCheck& check) {
  const fs::path file = folder / "journal.jsonl";
  const manifests::Journal journal(file);
  for (const std::int64_t line : journal.damaged_lines()) {
    check.problems.push_back(
        {file, fmt::format("line {} is damaged: its checksum or its fields do not match", line), ""});
  }
  for (const auto& [unit, entry] : journal.entries()) {
    run::throw_if_interrupted();
    ++check.files;
    const fs::path path = folder / entry.file;
    const auto got = manifests::if_present([&] { return manifests::sha256_file(path); });
    if (got == entry.sha256) continue;
    check.problems.push_back({path,
                              got ? fmt::format("SHA-256 is {}, its journal says {}", *got, entry.sha256)
                                  : fmt::format("it is gone; its journal says {}", entry.sha256),
                              entry.sha256});
  }
}

}  // namespace

StageCheck check_stages(const fs::path& out) {
  StageCheck check;
  for (const fs::path& folder : stage_folders(out)) {
    check_manifest(folder, check);
    check_units(folder, check);
  }
  for (DamagedPlan& plan : find_damaged_plans(out)) {
    check.problems.push_back({std::move(plan.file), std::move(plan.problem), ""});
  }
  return check;
}

}  // namespace q3d::pipeline::stages
