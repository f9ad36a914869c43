// dataset.json of a stranger: as it lies there, and with a digest that is right, since a stranger makes that
// too.
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "manifests/dataset_document.h"
#include "manifests/json_parse.h"
#include "manifests/sealed_json.h"
#include "pipeline/dataset/published_dataset.h"
#include "pipeline/stages/stage.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;
using q3d::pipeline::dataset::DatasetManifest;

bool is_one_name(const std::string& text) {
  return !text.empty() && text != "." && text != ".." &&
         text.find_first_of(std::string("/\\\0", 3)) == text.npos;
}

// Checks what readers rely on when they make paths and loops of it.
void check(const DatasetManifest& manifest) {
  require(is_one_name(manifest.name), "a dataset's name is a name, not a path", manifest.name);
  require(manifest.unit_size > 0, "units have candidates");
  for (const auto& shard : manifest.shards) {
    const bool is_below = shard.file.starts_with("shards/") && is_one_name(shard.file.substr(7));
    require(is_below, "a shard lies in the folder of shards", shard.file);
    require(shard.unit >= 0 && shard.rows >= 0 && shard.bytes >= 0, "counts are not negative", shard.file);
  }
  for (const auto stage : q3d::pipeline::stages::kStages) {
    const std::string& key = key_of(manifest.keys, stage);
    require(key.empty() || is_one_name(key), "a stage's key can be a part of a folder's name", key);
  }
}

void read(const std::filesystem::path& file) {
  q3d::fuzz::value_or_refusal(
      file, [&] { check(q3d::pipeline::dataset::PublishedDataset(file.parent_path()).manifest()); });
  q3d::fuzz::value_or_refusal(file, [&] {
    for (const auto& shard : q3d::manifests::read_listed_shards(file)) {
      require(is_one_name(shard.file.substr(7)), "a shard lies in the folder of shards", shard.file);
    }
  });
}

// A sealed document with another byte is refused, whichever byte it is.
void require_seal(const q3d::fuzz::Scratch& scratch, std::string text) {
  const std::size_t hash = std::hash<std::string>{}(text);
  char& byte = text[hash % text.size()];
  byte = static_cast<char>(byte ^ (1 << (hash >> 32U) % 8));
  const auto file = scratch.write("flipped/dataset.json", text);
  try {
    q3d::manifests::read_dataset_document(file);
  } catch (const q3d::manifests::DamagedDocument&) {
    return;
  }
  require(false, "a damaged dataset.json is refused", text);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const q3d::fuzz::Scratch scratch;
  const std::string_view bytes = q3d::fuzz::as_text(data, size);
  read(scratch.write("dataset.json", bytes));
  auto document = q3d::manifests::parse_json_or_null<nlohmann::ordered_json>(bytes);
  if (!document.is_object()) return 0;
  document.erase(q3d::manifests::kDigestKey);
  if (document.empty()) return 0;
  const std::string sealed = q3d::manifests::seal_json(document);
  read(scratch.write("dataset.json", sealed));
  require_seal(scratch, sealed);
  return 0;
}
