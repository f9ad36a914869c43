#include "pipeline/build/up_to_date.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "manifests/next_field.h"
#include "pipeline/build/file_stamps.h"
#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;
using loaders::formats::NoteKind;
using nlohmann::json;

constexpr int kForm = 1;  // of the record
constexpr std::size_t kMostEntries = 20'000'000;
// Stamps of one tick of the file system's clock do not tell two writes apart. Linux ticks every 10 ms or
// faster; a time in whole seconds comes from a file system that has no finer ones.
constexpr std::int64_t kTickNs = 50'000'000;
constexpr std::int64_t kCoarseTickNs = 2'000'000'000;

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::int64_t tick_of(std::int64_t time_ns) {
  return time_ns % manifests::kNsPerSecond == 0 ? kCoarseTickNs : kTickNs;
}

// A digest of what the user asks for, and of the output folder's place: in a copy of the folder, the record
// would speak of the files of the other one. The program's own stamp stands for its code.
std::string request_digest(const fs::path& out, const config::BuildConfig& config,
                           const config::JudgingRules& rules, const std::string& device_key) {
  json datasets = json::array();
  for (const config::DatasetConfig& dataset : config.datasets) {
    datasets.push_back({dataset.name, dataset.split, fs::absolute(dataset.root).string()});
  }
  const json request{{"form", kForm},
                     {"out", fs::weakly_canonical(out).string()},
                     {"config", config.as_written},
                     {"stages", stages::keys_of_config(config, rules, {}, device_key).shards},
                     {"datasets", datasets},
                     {"veto", config.veto.string()},
                     {"corrections", config.corrections.string()}};
  return manifests::sha256(request.dump());
}

void add(std::vector<std::string>& paths, const fs::path& path) {
  if (!path.empty()) paths.push_back(fs::absolute(path).string());
}

// The files that make the program: it and its libraries of this project.
void add_program(std::vector<std::string>& paths) {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) paths.push_back(program.string());
}

// Changes of these bring pictures to light or hide them.
bool add_folders(std::vector<std::string>& paths, const fs::path& folder, const fs::path& except) {
  if (folder.empty()) return true;
  const auto found = folders_below(fs::absolute(folder).lexically_normal(), except, kMostEntries);
  if (!found) return false;
  paths.insert(paths.end(), found->begin(), found->end());
  return true;
}

std::vector<std::string> published_files(const fs::path& folder) {
  std::vector<std::string> paths{(folder / "dataset.json").string(), (folder / "verdicts.csv").string()};
  for (const auto& entry : fs::directory_iterator(folder / "shards")) paths.push_back(entry.path().string());
  paths.push_back((folder / "shards").string());  // tells of files that are added or removed
  return paths;
}

// Waits until a further write would get a later stamp.
void let_clock_tick(const std::vector<StampedFile>& files) {
  const std::int64_t newest = newest_change_ns(files);
  const std::int64_t wait = newest + tick_of(newest) - now_ns();
  if (wait > 0 && wait <= kCoarseTickNs) std::this_thread::sleep_for(std::chrono::nanoseconds(wait));
}

fs::path record_file(const fs::path& out, const std::string& request) {
  return stages::plans_folder(out) / (request.substr(0, stages::kShortKey) + ".stamps");
}

}  // namespace

UpToDateRecord::UpToDateRecord(const fs::path& out, const config::BuildConfig& config,
                               const config::JudgingRules& rules, const std::string& device_key)
    : out_(out),
      config_(config),
      request_(request_digest(out, config, rules, device_key)),
      begun_ns_(now_ns()) {}

// The record's lines after its head. Throws json::exception and std::invalid_argument for others.
std::optional<UpToDateRecord::Unchanged> UpToDateRecord::read(std::string_view text) const {
  const json said = json::parse(manifests::next_field(text, '\n'));
  if (!have_stamps(stamps_from_text(text))) return std::nullopt;
  Unchanged found{out_ / said.at("folder").get<std::string>(),
                  {},
                  said.at("candidates").get<std::int64_t>(),
                  said.at("units").get<std::int64_t>()};
  for (const json& note : said.at("notes")) {
    const bool is_caution = note.at(0).get<std::string>() == to_string(NoteKind::caution);
    found.notes.push_back({is_caution ? NoteKind::caution : NoteKind::remark, note.at(1).get<std::string>(),
                           note.at(2).get<std::string>()});
  }
  return found;
}

std::optional<UpToDateRecord::Unchanged> UpToDateRecord::unchanged() const {
  const fs::path file = record_file(out_, request_);
  if (config_.leakage || !fs::exists(file)) return std::nullopt;
  const std::string content = manifests::read_file(file);
  std::string_view text = content;
  const std::string_view head = manifests::next_field(text, '\n');
  if (head != manifests::sha256(text) + ' ' + request_) return std::nullopt;
  try {
    return read(text);
  } catch (const json::exception&) {
    return std::nullopt;
  } catch (const std::invalid_argument&) {
    return std::nullopt;
  }
}

std::optional<std::vector<std::string>> UpToDateRecord::inputs(const candidates::Ingest& ingest) const {
  std::vector<std::string> paths;
  for (const candidates::Candidate& candidate : ingest.candidates) {
    if (!candidate.record.image_path.empty()) paths.push_back(candidate.record.image_path);
    if (!candidate.record.mask_path.empty()) paths.push_back(candidate.record.mask_path);
  }
  const fs::path except = fs::absolute(out_).lexically_normal();
  for (const fs::path& file : ingest.files) {
    add(paths, file);
    add(paths, file.parent_path());
  }
  for (const config::DatasetConfig& dataset : config_.datasets) {
    for (const fs::path& file :
         {dataset.annotations, dataset.topology, dataset.curation, dataset.body_model}) {
      if (!file.empty()) add(paths, dataset.root / file);  // an absolute path stays as it is
    }
    for (const fs::path& world : {dataset.root, dataset.root.parent_path()}) add(paths, world / "world.json");
    if (!add_folders(paths, dataset.root, except)) return std::nullopt;
    if (!dataset.images.empty() && !add_folders(paths, dataset.root / dataset.images, except))
      return std::nullopt;
  }
  for (const fs::path& file : {config_.veto, config_.corrections}) add(paths, file);
  if (config::needs_network(config_)) {
    for (const fs::path& file :
         {config_.network.checkpoint, config_.network.smal_asset, config::priors_file(config_)}) {
      add(paths, file);
    }
  }
  add_program(paths);
  return paths;
}

void UpToDateRecord::keep(const candidates::Ingest& ingest, const fs::path& folder) const {
  if (config_.leakage) return;
  auto paths = inputs(ingest);
  if (!paths) return;
  std::vector<StampedFile> files = stamp_files(std::move(*paths));
  const std::int64_t newest = newest_change_ns(files);
  if (newest + tick_of(newest) > begun_ns_) return;  // a later build leaves the record
  std::vector<StampedFile> published = stamp_files(published_files(folder));
  let_clock_tick(published);
  if (!have_stamps(published)) return;
  files.insert(files.end(), std::make_move_iterator(published.begin()),
               std::make_move_iterator(published.end()));
  const auto stamps = to_text(std::move(files));
  if (!stamps) return;
  json notes = json::array();
  for (const candidates::IngestNote& note : ingest.notes) {
    notes.push_back({to_string(note.kind), note.dataset, note.text});
  }
  const json said{{"folder", folder.filename().string()},
                  {"candidates", ingest.candidates.size()},
                  {"units", ingest.units.size()},
                  {"notes", notes}};
  const std::string text = said.dump() + '\n' + *stamps;
  manifests::write_file_atomically(record_file(out_, request_),
                                   fmt::format("{} {}\n{}", manifests::sha256(text), request_, text));
}

}  // namespace q3d::pipeline::build
