#include "pipeline/report/report_run.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/json_parse.h"
#include "pipeline/report/embedded_files.h"
#include "pipeline/report/overlay_run.h"
#include "pipeline/report/report_galleries.h"
#include "pipeline/report/report_page.h"
#include "pipeline/run/log.h"
#include "pipeline/run/version.h"
#include "pipeline/statistics/statistics.h"

namespace q3d::pipeline::report {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr const char* kPage = "report.html";
constexpr const char* kStatistics = "statistics.json";
constexpr const char* kManifest = "manifest.json";
constexpr const char* kTsne = "tsne.json";
constexpr int kCode = 1;  // raise it when the same dataset gives another page or other statistics

std::string text_of_file(const fs::path& file) {
  return fs::exists(file) ? manifests::read_file(file) : std::string();
}

// Returns a key of everything on which the two files depend. Pictures and stage tables lie outside the
// dataset and are not part of it, because a page that was made with them stays correct.
std::string key_of(const dataset::PublishedDataset& dataset, const ReportOptions& options, bool has_bodies,
                   const std::string& tsne) {
  const dataset::DatasetManifest& manifest = dataset.manifest();
  return manifests::sha256(
      fmt::format("report {} {}\n{}\n{}\n{}\n{} {}\n{}\n{}\n{}\n", kCode, run::version(), manifest.key,
                  manifest.content_id, manifest.verdicts_sha256, options.gallery_size, has_bodies,
                  manifests::sha256(tsne), manifests::sha256(page_template()),
                  manifests::sha256(std::string(page_style()) + std::string(page_charts()) +
                                    std::string(page_explorer()) + std::string(page_further_charts()))));
}

// Returns whether a member of the object is this text. A damaged file may have a value of another type there.
bool says(const ordered_json& object, const char* member, const std::string& text) {
  return object.is_object() && object.value(member, ordered_json()) == text;
}

bool is_up_to_date(const fs::path& folder, const std::string& key) {
  const std::string text = text_of_file(folder / kManifest);
  const ordered_json manifest = manifests::parse_json_or_null<ordered_json>(text);
  if (!says(manifest, "key", key)) return false;
  const ordered_json files = manifest.value("files", ordered_json());
  for (const char* name : {kStatistics, kPage}) {
    const fs::path file = folder / name;
    if (!fs::exists(file) || !says(files, name, manifests::sha256_file(file))) return false;
  }
  return true;
}

// Returns the t-SNE of the same labels, or null. A file of another dataset is reported, because the user made
// it.
ordered_json tsne_of(const std::string& text, const dataset::DatasetManifest& manifest,
                     const fs::path& file) {
  if (text.empty()) return nullptr;
  ordered_json tsne = manifests::parse_json_or_null<ordered_json>(text);
  if (says(tsne, "content_id", manifest.content_id)) return tsne;
  run::log_warning(
      fmt::format("{}: it is not of this dataset ({}) and is not shown; tools/shape_tsne.py makes it again",
                  file.string(), manifest.content_id.substr(0, 16)));
  return nullptr;
}

class ReportWriter {
 public:
  ReportWriter(const ReportOptions& options, const device::BodyMeshesLoader& load_bodies)
      : options_(options),
        dataset_(options.dataset),
        files_(dataset_.output_folder(), options.config ? &*options.config : nullptr),
        load_bodies_(load_bodies) {}

  ReportSummary write() {
    const fs::path folder = options_.folder.empty()
                                ? dataset_.output_folder() / "report" / dataset_.version_name()
                                : options_.folder;
    const std::string tsne = text_of_file(folder / kTsne);
    find_body();
    const std::string key = key_of(dataset_, options_, !body_.empty(), tsne);
    ReportSummary summary{folder / kPage, folder / kStatistics, is_up_to_date(folder, key)};
    if (summary.was_up_to_date) return summary;
    fs::create_directories(folder);
    const statistics::Facts facts = statistics::gather(dataset_);
    ordered_json numbers = statistics::statistics(dataset_, facts);
    const ordered_json pictures = galleries(facts, numbers);
    write_files(folder, key, std::move(numbers), pictures,
                tsne_of(tsne, dataset_.manifest(), folder / kTsne));
    return summary;
  }

 private:
  void find_body() {
    try {
      body_ = find_body_model(dataset_, files_, options_.body);
    } catch (const MissingBodyModel& error) {
      no_body_ = fmt::format("The pictures show no meshes: {}", error.what());
      run::log_note(no_body_);
    }
  }

  // Draws the galleries. Adds a note to `numbers` if there are no meshes.
  ordered_json galleries(const statistics::Facts& facts, ordered_json& numbers) const {
    std::vector<dataset::VerdictRow> rows;
    for (const statistics::CandidateFacts& candidate : facts.candidates) rows.push_back(candidate.row);
    const std::unique_ptr<device::BodyMeshes> bodies = body_.empty() ? nullptr : load_bodies_(body_);
    if (!no_body_.empty()) numbers["notes"].push_back(no_body_);
    const OverlayPainter painter(bodies.get());
    return draw_galleries(dataset_, files_, painter, plan_galleries(dataset_, rows, options_.gallery_size));
  }

  static void write_files(const fs::path& folder, const std::string& key, ordered_json numbers,
                          const ordered_json& pictures, ordered_json tsne) {
    const std::string text = numbers.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    if (!tsne.is_null()) numbers["tsne"] = std::move(tsne);
    const std::string page = report_html(numbers, pictures);
    manifests::write_file_atomically(folder / kStatistics, text);
    manifests::write_file_atomically(folder / kPage, page);
    const ordered_json manifest = {
        {"stage", "report"},
        {"key", key},
        {"files", {{kStatistics, manifests::sha256(text)}, {kPage, manifests::sha256(page)}}}};
    manifests::write_file_atomically(folder / kManifest, manifest.dump(2) + "\n");
  }

  const ReportOptions& options_;
  dataset::PublishedDataset dataset_;
  SourceFiles files_;
  const device::BodyMeshesLoader& load_bodies_;
  fs::path body_;        // empty if none was found
  std::string no_body_;  // the reason why no body was found
};

}  // namespace

ReportSummary write_report(const ReportOptions& options, const device::BodyMeshesLoader& load_bodies) {
  return ReportWriter(options, load_bodies).write();
}

}  // namespace q3d::pipeline::report
