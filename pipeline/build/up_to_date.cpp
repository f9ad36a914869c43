#include "pipeline/build/up_to_date.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <span>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/block_reader.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "manifests/file_stamp.h"
#include "pipeline/build/file_stamps.h"
#include "pipeline/stages/build_plan.h"
#include "pipeline/stages/stages.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;
using loaders::formats::NoteKind;
using manifests::PathTable;
using nlohmann::json;

constexpr int kForm = 2;  // of the record
constexpr std::size_t kFilesAtOnce = 16'384;
constexpr std::size_t kMostEntries = 20'000'000;
// Two writes within one tick of the file system's clock have the same stamp. Linux ticks every 10 ms or
// faster; a time in whole seconds comes from a file system without finer times.
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

// Appends a text with its length before it. Paths may hold any bytes, which JSON does not take.
void append_text(const std::string& text, std::string& request) {
  request += fmt::format("{}:", text.size());
  request += text;
}

// A digest of what the user asks for, and of the output folder's place: in a copy of the folder, the record
// would speak of the files of the other one. The program's own stamp stands for its code.
std::string request_digest(const fs::path& out, const config::BuildConfig& config,
                           const config::JudgingRules& rules, const std::string& device_key) {
  const json settings{{"form", kForm},
                      {"config", config.as_written},
                      {"stages", stages::keys_of_config(config, rules, {}, device_key).shards}};
  std::string request;
  append_text(settings.dump(), request);
  append_text(fs::weakly_canonical(out).string(), request);
  for (const config::DatasetConfig& dataset : config.datasets) {
    for (const std::string& text : {dataset.name, dataset.split, fs::absolute(dataset.root).string()}) {
      append_text(text, request);
    }
  }
  append_text(config.veto.string(), request);
  append_text(config.corrections.string(), request);
  return manifests::sha256(request);
}

void add(PathTable& paths, const fs::path& path) {
  if (!path.empty()) paths.add(fs::absolute(path).string());
}

// The file of the program, whose stamp stands for its code. Returns false if it is no longer there: the
// program was replaced while it ran, and its file's stamp can never be compared.
bool add_program(PathTable& paths) {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (error || !manifests::stamp_of(program)) return false;
  paths.add(program.string());
  return true;
}

// Adds folders in which a picture could appear or disappear.
bool add_folders(PathTable& paths, const fs::path& folder, const fs::path& except) {
  if (folder.empty()) return true;
  const auto found = folders_below(fs::absolute(folder).lexically_normal(), except, kMostEntries);
  if (!found) return false;
  for (const std::string& path : *found) paths.add(path);
  return true;
}

std::vector<std::string> published_files(const fs::path& folder) {
  std::vector<std::string> paths{(folder / "dataset.json").string(), (folder / "verdicts.csv").string()};
  for (const auto& entry : fs::directory_iterator(folder / "shards")) paths.push_back(entry.path().string());
  paths.push_back((folder / "shards").string());  // its stamp changes if files are added or removed
  return paths;
}

// Waits until another write would get a later stamp.
void let_clock_tick(const std::vector<StampedFile>& files) {
  const std::int64_t newest = newest_change_ns(files);
  const std::int64_t wait = newest + tick_of(newest) - now_ns();
  if (wait > 0 && wait <= kCoarseTickNs) std::this_thread::sleep_for(std::chrono::nanoseconds(wait));
}

// Writes the text of a record. Its last line holds the digest of everything before it.
class RecordWriter {
 public:
  explicit RecordWriter(const fs::path& file) : file_(file) {}

  void write(std::string_view text) {
    digest_.update(std::as_bytes(std::span(text)));
    file_.write(text);
  }
  // Returns false if a path cannot be written as a line.
  bool write(std::span<const StampedFile> files) {
    std::string text;
    const bool fits = stamps_.append(files, text);
    write(text);
    return fits;
  }
  void commit() {
    file_.write(digest_.hex() + '\n');
    file_.commit();
  }

 private:
  manifests::AtomicWriter file_;
  manifests::Sha256 digest_;
  StampWriter stamps_;
};

// Reads the lines of a record except the last.
class RecordReader {
 public:
  explicit RecordReader(const fs::path& file) : lines_(file) { advance(); }

  std::optional<std::string> next() {
    if (!ahead_) return std::nullopt;
    std::string line = std::move(*ahead_);
    advance();
    if (!ahead_) {
      last_ = std::move(line);
      return std::nullopt;
    }
    line += '\n';
    digest_.update(std::as_bytes(std::span(line)));
    line.pop_back();
    return line;
  }
  // Returns, after all lines were read, whether the last line has the digest of the others.
  bool is_sound() { return lines_.was_whole() && last_ == digest_.hex(); }

 private:
  void advance() {
    const auto line = lines_.next();
    ahead_ = line ? std::optional<std::string>(*line) : std::nullopt;
  }

  manifests::LineReader lines_;
  std::optional<std::string> ahead_;
  std::string last_;
  manifests::Sha256 digest_;
};

// Returns whether every file of the record's remaining lines has its stamp.
bool has_all_stamps(RecordReader& record) {
  StampReader stamps;
  std::vector<StampedFile> files;
  for (bool is_end = false; !is_end;) {
    const std::optional<std::string> line = record.next();
    is_end = !line;
    if (line && !stamps.read(*line, files)) return false;
    if (!is_end && files.size() < kFilesAtOnce) continue;
    if (!have_stamps(files)) return false;
    files.clear();
  }
  return true;
}

// Returns the result that a record's head states. Throws json::exception for any other text.
UpToDateRecord::Unchanged result_in(const std::string& head, const fs::path& out) {
  const json said = json::parse(head);
  UpToDateRecord::Unchanged found{out / said.at("folder").get<std::string>(),
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

std::optional<UpToDateRecord::Unchanged> UpToDateRecord::unchanged() const {
  const fs::path file = record_file(out_, request_);
  if (config_.leakage || !fs::exists(file)) return std::nullopt;
  RecordReader record(file);
  const std::optional<std::string> request = record.next();
  const std::optional<std::string> head = record.next();
  if (request != request_ || !head || !has_all_stamps(record) || !record.is_sound()) return std::nullopt;
  try {
    return result_in(*head, out_);
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

std::optional<PathTable> UpToDateRecord::inputs(const candidates::Ingest& ingest) const {
  PathTable paths;
  ingest.candidates.for_each([&](std::size_t, const candidates::Candidate& candidate) {
    if (!candidate.record.image_path.empty()) paths.add(candidate.record.image_path);
    if (!candidate.record.mask_path.empty()) paths.add(candidate.record.mask_path);
  });
  const fs::path except = fs::absolute(out_).lexically_normal();
  for (const fs::path& file : ingest.files) {
    add(paths, file);
    add(paths, file.parent_path());
  }
  for (const config::DatasetConfig& dataset : config_.datasets) {
    for (const fs::path& file :
         {dataset.annotations, dataset.topology, dataset.curation, dataset.body_model}) {
      if (!file.empty()) add(paths, dataset.root / file);  // an absolute path is unchanged
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
  if (!add_program(paths)) return std::nullopt;
  return paths;
}

void UpToDateRecord::keep(const candidates::Ingest& ingest, const fs::path& folder) const {
  const fs::path file = record_file(out_, request_);
  // A build that was killed while it wrote its record has left a temporary file.
  if (fs::exists(file.parent_path())) manifests::remove_temporaries(file.parent_path());
  if (config_.leakage) return;
  const auto paths = inputs(ingest);
  if (!paths) return;
  json notes = json::array();
  for (const candidates::IngestNote& note : ingest.notes) {
    notes.push_back({to_string(note.kind), note.dataset, note.text});
  }
  const json said{{"folder", folder.filename().string()},
                  {"candidates", ingest.candidates.size()},
                  {"units", ingest.units.size()},
                  {"notes", notes}};
  RecordWriter record(file);
  record.write(request_ + '\n');
  record.write(said.dump() + '\n');
  std::int64_t newest = 0;
  for (std::uint32_t first = 0; first < paths->size();) {
    std::vector<std::string> part;
    for (; first < paths->size() && part.size() < kFilesAtOnce; ++first) part.push_back(paths->path(first));
    const std::vector<StampedFile> files = stamp_files(std::move(part));
    newest = std::max(newest, newest_change_ns(files));
    if (!record.write(files)) return;
  }
  if (newest + tick_of(newest) > begun_ns_) return;  // a later build will write the record
  const std::vector<StampedFile> published = stamp_files(published_files(folder));
  let_clock_tick(published);
  if (!have_stamps(published) || !record.write(published)) return;
  record.commit();
}

}  // namespace q3d::pipeline::build
