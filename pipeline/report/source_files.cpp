#include "pipeline/report/source_files.h"

#include <fmt/format.h>

#include "loaders/pictures/image.h"
#include "manifests/digest.h"
#include "manifests/known_files.h"
#include "pipeline/candidates/configured_dataset.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::report {
namespace {

namespace fs = std::filesystem;

// Returns nothing if the file is gone or its bytes differ from the expected digest.
std::optional<std::vector<std::byte>> read_expected(const fs::path& path, const std::string& sha256) {
  loaders::pictures::FileBytes file = loaders::pictures::read_picture_file(path);
  if (file.failure != manifests::Reason::none || manifests::sha256(file.bytes) != sha256) return std::nullopt;
  return std::move(file.bytes);
}

}  // namespace

SourceFiles::SourceFiles(const fs::path& output_folder, const config::BuildConfig* config)
    : known_(manifests::read_known_files(output_folder / "digests.txt")) {
  if (config == nullptr) return;
  if (!config->network.smal_asset.empty()) configured_bodies_.push_back(config->network.smal_asset);
  for (const config::DatasetConfig& dataset : config->datasets) {
    if (!dataset.body_model.empty()) configured_bodies_.push_back(dataset.body_model);
    for (const manifests::SampleRecord& record : candidates::load_configured(dataset).records) {
      if (!record.image_path.empty())
        configured_.emplace(record.id, Configured{record.image_path, record.orientation});
    }
  }
}

std::optional<SourceFiles::Picture> SourceFiles::picture(const std::string& id,
                                                         const std::string& sha256) const {
  if (sha256.empty()) return std::nullopt;
  if (const auto own = configured_.find(id); own != configured_.end()) {
    if (auto bytes = read_expected(own->second.path, sha256)) {
      return Picture{std::move(*bytes), own->second.orientation};
    }
  }
  const auto [first, last] = known_.equal_range(sha256);
  for (auto file = first; file != last; ++file) {
    if (auto bytes = read_expected(file->second, sha256)) return Picture{std::move(*bytes)};
  }
  return std::nullopt;
}

std::optional<fs::path> SourceFiles::body_model(const std::string& sha256, const fs::path& given) const {
  if (!given.empty()) {
    const std::string got = manifests::sha256_file(given);
    if (sha256.empty() || got == sha256) return given;
    throw run::ConfigError(fmt::format(
        "{}: its SHA-256 is {}, expected {}: it is not the body model that the dataset was made with",
        given.string(), got, sha256));
  }
  if (sha256.empty()) {
    return configured_bodies_.empty() ? std::nullopt : std::optional(configured_bodies_.front());
  }
  std::vector<fs::path> places = configured_bodies_;
  const auto [first, last] = known_.equal_range(sha256);
  for (auto file = first; file != last; ++file) places.push_back(file->second);
  for (const fs::path& place : places) {
    if (fs::exists(place) && manifests::sha256_file(place) == sha256) return place;
  }
  return std::nullopt;
}

}  // namespace q3d::pipeline::report
