#include "pipeline/dataset/is_published.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <optional>
#include <stdexcept>
#include <vector>

#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "manifests/sealed_json.h"
#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/log.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;

struct ListedFile {
  fs::path path;
  std::string expected;              // SHA-256
  std::optional<std::string> got{};  // of the bytes; nothing if there is no such file
};

// Reads dataset.json. Returns nothing, and warns, if the file is not as it was written.
std::optional<DatasetManifest> read_undamaged(const fs::path& folder) {
  try {
    return read_dataset_manifest(folder);
  } catch (const manifests::DamagedDocument& error) {
    run::log_warning(fmt::format("damaged: {}; it is published again", error.what()));
    return std::nullopt;
  }
}

}  // namespace

bool is_published(const fs::path& folder, const std::string& key) {
  if (!fs::exists(folder / "dataset.json")) return false;
  const std::optional<DatasetManifest> manifest = read_undamaged(folder);
  if (!manifest) return false;
  if (manifest->key != key) {
    throw std::runtime_error(
        fmt::format("{}: holds a dataset with key {}, expected {}; a finished dataset is never "
                    "written over. Build into another folder",
                    folder.string(), manifest->key, key));
  }
  std::vector<ListedFile> files;
  for (const ShardEntry& shard : manifest->shards) files.push_back({folder / shard.file, shard.sha256});
  files.push_back({folder / "verdicts.csv", manifest->verdicts_sha256});
  tbb::parallel_for(std::size_t{0}, files.size(), [&](std::size_t i) {
    if (run::interrupted()) return;
    files[i].got = manifests::if_present([&] { return manifests::sha256_file(files[i].path); });
  });
  run::throw_if_interrupted();
  bool is_sound = true;
  for (const ListedFile& file : files) {
    if (file.got == file.expected) continue;
    is_sound = false;
    run::log_warning(fmt::format("{}: damaged: {}, expected {} by dataset.json; it is published again",
                                 file.path.string(), file.got ? "got SHA-256 " + *file.got : "it is gone",
                                 file.expected));
  }
  return is_sound;
}

}  // namespace q3d::pipeline::dataset
