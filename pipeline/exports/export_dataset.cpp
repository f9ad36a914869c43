#include "pipeline/exports/export_dataset.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "loaders/pictures/crop.h"
#include "manifests/digest.h"
#include "pipeline/dataset/export_list.h"
#include "pipeline/dataset/published_dataset.h"
#include "pipeline/exports/format_writer.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/progress.h"

namespace q3d::pipeline::exports {
namespace {

namespace fs = std::filesystem;
using dataset::PublishedDataset;
using dataset::ShardEntry;
using manifests::ShardSample;
using nlohmann::ordered_json;

constexpr int kCode = 2;  // raise it when an export's bytes or their meaning change
constexpr std::int64_t kRowsAtOnce = 64;
constexpr double kSameCropPx = 1e-6;

std::string source_of(const ShardSample& sample) {
  return sample.record.dataset + "/" + sample.record.split;
}

class Exporter {
 public:
  Exporter(const fs::path& given, const ExportOptions& options)
      : dataset_(given),
        options_(options),
        arena_(options.threads > 0 ? options.threads : oneapi::tbb::task_arena::automatic),
        writer_(make_writer()),
        folder_(options.out, about()) {}

  ExportSummary run() {
    dataset::list_export(dataset_, format_name(), options_.pictures_anyway, options_.out);
    if (folder_.is_complete()) return summary_of_manifest();
    const std::vector<ShardEntry>& shards = dataset_.manifest().shards;
    run::Progress progress("samples", total_rows(), options_.quiet);
    for (const ShardEntry& entry : shards) {
      run::throw_if_interrupted();
      const bool is_done = folder_.has_part(entry.unit, entry.sha256);
      if (!is_done) export_unit(entry);
      progress.advance(entry.rows, is_done);
    }
    for (const ShardEntry& entry : shards) writer_->take(folder_.take_part(entry.unit));
    const auto records = writer_->assemble(folder_);
    folder_.write("croissant.json", croissant_text(croissant(records)));
    folder_.finish(summary_json());
    ExportSummary summary = summary_of_manifest();
    summary.was_complete = false;
    return summary;
  }

 private:
  std::unique_ptr<FormatWriter> make_writer() const {
    std::set<manifests::ImageEncoding> encodings;
    std::map<std::string, manifests::Family> species;
    for (const ShardEntry& entry : dataset_.manifest().shards) {
      const manifests::ShardReader shard = dataset_.open_shard(entry);
      encodings.insert(shard.header().image_encoding);
      const auto names = shard.table().text("species", 0, shard.rows());
      const auto families = shard.table().numeric("family", 0, shard.rows());
      for (std::size_t row = 0; row < names.size(); ++row) {
        species.emplace(names[row], static_cast<manifests::Family>(families.as<std::int8_t>()[row]));
      }
    }
    if (encodings.size() > 1) {
      throw std::runtime_error(
          fmt::format("{}: its shards have pictures of different encodings; export them "
                      "from the datasets that it was merged from",
                      dataset_.folder().string()));
    }
    ExportedDataset exported;
    exported.title = fmt::format("{} {} ({})", dataset_.manifest().name, dataset_.manifest().version,
                                 dataset_.version_name());
    exported.content_id = dataset_.manifest().content_id;
    exported.suffix = encodings.contains(manifests::ImageEncoding::jpeg) ? "jpg" : "png";
    exported.unit_size = dataset_.manifest().unit_size;
    exported.species.assign(species.begin(), species.end());
    return options_.format == Format::prima ? make_prima_writer(std::move(exported))
                                            : make_coco_writer(std::move(exported));
  }

  const char* format_name() const { return options_.format == Format::prima ? "prima" : "coco"; }

  ordered_json about() const {
    return {{"format", "quadruped3d-export"},
            {"export", format_name()},
            {"code", kCode},
            {"name", dataset_.manifest().name},
            {"version", dataset_.manifest().version},
            {"key", dataset_.manifest().key},
            {"content_id", dataset_.manifest().content_id},
            {"pictures_anyway", options_.pictures_anyway}};
  }

  bool is_licensed(const std::string& source) const {
    if (options_.pictures_anyway) return true;
    const auto terms = dataset_.manifest().terms.find(source);
    return terms != dataset_.manifest().terms.end() && !terms->second.licence.empty();
  }

  std::int64_t total_rows() const {
    std::int64_t rows = 0;
    for (const ShardEntry& entry : dataset_.manifest().shards) rows += entry.rows;
    return rows;
  }

  void export_unit(const ShardEntry& entry) {
    const std::string digest = manifests::sha256_file(dataset_.shard_file(entry));
    if (digest != entry.sha256) {
      throw std::runtime_error(fmt::format("{}: SHA-256 is {}, dataset.json says {}; run `verify`",
                                           dataset_.shard_file(entry).string(), digest, entry.sha256));
    }
    const manifests::ShardReader shard = dataset_.open_shard(entry);
    std::string text;
    ExportFolder::Files pictures;
    for (std::int64_t first = 0; first < shard.rows(); first += kRowsAtOnce) {
      const std::vector<ShardSample> samples =
          shard.samples(first, std::min(kRowsAtOnce, shard.rows() - first));
      std::vector<SampleExport> exported(samples.size());
      arena_.execute([&] {
        oneapi::tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t i) {
          exported[i] = export_sample(samples[i], shard.header().image_encoding, entry.unit,
                                      first + static_cast<std::int64_t>(i));
        });
      });
      for (SampleExport& each : exported) {
        text += each.lines;
        pictures.merge(each.pictures);
      }
    }
    folder_.save_part(entry.unit, entry.sha256, shard.rows(), text, pictures);
  }

  struct SampleExport {
    std::string lines;
    ExportFolder::Files pictures;
  };

  SampleExport export_sample(const ShardSample& sample, manifests::ImageEncoding encoding, std::int64_t unit,
                             std::int64_t row) const {
    const bool has_picture = !sample.crop.empty() && is_licensed(source_of(sample));
    const ExportedPicture picture =
        export_picture(sample, encoding, has_picture ? writer_->pictures() : Pictures::none);
    if (writer_->pictures() == Pictures::official) check_crop(sample, picture);
    const ExportedSample exported{sample, picture, unit, row};
    SampleExport result{writer_->lines(exported), {}};
    for (const PictureFile& file : writer_->picture_files(exported)) {
      result.pictures[file.name] = folder_.write_picture(file.name, *file.bytes);
    }
    return result;
  }

  // Checks that the official code, which gets only the box, cuts exactly the crop to which the label refers.
  static void check_crop(const ShardSample& sample, const ExportedPicture& picture) {
    const auto square = loaders::pictures::square_box(exported_box(sample, picture));
    const auto centre =
        loaders::pictures::map_point(picture.from_image, {sample.patch_box[0], sample.patch_box[1]});
    const double side = sample.patch_box[2] * picture.from_image[0];
    if (std::abs(square.center_x_px - centre.x) <= kSameCropPx &&
        std::abs(square.center_y_px - centre.y) <= kSameCropPx &&
        std::abs(square.side_px - side) <= kSameCropPx * side) {
      return;
    }
    throw std::runtime_error(fmt::format(
        "sample {}: its box gives a crop at ({}, {}) px of side {}, expected ({}, {}) and {}: the label's "
        "crop was not made from this box",
        sample.record.id, square.center_x_px, square.center_y_px, square.side_px, centre.x, centre.y, side));
  }

  // Returns how many of the samples have a picture, and the datasets without a licence.
  ordered_json summary_json() const {
    std::int64_t pictures = 0;
    std::set<std::string> without;
    for (const ShardEntry& entry : dataset_.manifest().shards) {
      const manifests::ShardReader shard = dataset_.open_shard(entry);
      if (shard.header().image_encoding == manifests::ImageEncoding::reference) continue;
      const auto names = shard.table().text("dataset", 0, shard.rows());
      const auto splits = shard.table().text("split", 0, shard.rows());
      for (std::size_t row = 0; row < names.size(); ++row) {
        const std::string source = names[row] + "/" + splits[row];
        if (is_licensed(source)) {
          ++pictures;
        } else {
          without.insert(source);
        }
      }
    }
    ordered_json terms = ordered_json::object();
    for (const auto& [name, own] : dataset_.manifest().terms) {
      terms[name] = {{"licence", own.licence}, {"source_url", own.source_url}, {"citation", own.citation}};
    }
    return {
        {"samples", total_rows()}, {"pictures", pictures}, {"without_licence", without}, {"datasets", terms}};
  }

  CroissantDataset croissant(const std::vector<CroissantRecords>& records) const {
    const dataset::DatasetManifest& manifest = dataset_.manifest();
    CroissantDataset result;
    result.name = manifest.name;
    result.version = manifest.version;
    result.description = fmt::format(
        "3D labels (SMAL pose, shape and camera) of {} quadrupeds in photographs, kept of {} candidates and "
        "built by quadruped3d {}.",
        total_rows(), manifest.counts.candidates, manifest.toolkit);
    std::set<std::string> licences;
    for (const auto& [name, own] : manifest.terms) {
      licences.insert(own.licence.empty() ? "not stated" : own.licence);
      if (!own.citation.empty()) result.citations.push_back(own.citation);
      if (!own.source_url.empty()) result.sources.push_back(own.source_url);
    }
    if (licences.empty()) licences.insert("not stated");
    result.licences.assign(licences.begin(), licences.end());
    result.records = records;
    const bool has_pictures = summary_json().at("pictures").get<std::int64_t>() > 0;
    if (has_pictures) result.picture_patterns = writer_->picture_patterns();
    return result;
  }

  ExportSummary summary_of_manifest() const {
    const ordered_json& manifest = folder_.manifest();
    ExportSummary summary;
    summary.samples = manifest.at("samples").get<std::int64_t>();
    summary.pictures = manifest.at("pictures").get<std::int64_t>();
    summary.without_licence = manifest.at("without_licence").get<std::vector<std::string>>();
    for (const ordered_json& file : manifest.at("files")) {
      summary.files.push_back(file.at("file").get<std::string>());
    }
    summary.was_complete = true;
    return summary;
  }

  PublishedDataset dataset_;
  ExportOptions options_;
  oneapi::tbb::task_arena arena_;
  std::unique_ptr<FormatWriter> writer_;
  ExportFolder folder_;
};

}  // namespace

ExportSummary export_dataset(const fs::path& dataset, const ExportOptions& options) {
  return Exporter(dataset, options).run();
}

}  // namespace q3d::pipeline::exports
