#include "manifests/dataset_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/sealed_json.h"

namespace q3d::manifests {

using nlohmann::ordered_json;

ordered_json read_dataset_document(const std::filesystem::path& file) {
  SealedDocument sealed = read_sealed_json(file);
  const auto is = [&](const char* key, const ordered_json& value) {
    const auto found = sealed.document.find(key);
    return found != sealed.document.end() && *found == value;
  };
  const bool may_lack_digest = !is("format", kDatasetFormat) || is("schema", 1);
  if (sealed.has_digest || may_lack_digest) return std::move(sealed.document);
  throw DamagedDocument(
      fmt::format("{}: got no digest at its end, expected one, which only files of schema 1 lack; run the "
                  "`build` that made it again, or take the file from a copy",
                  file.string()));
}

std::string shard_name(const ordered_json& value) {
  constexpr std::string_view kFolder = "shards/";
  const auto name = value.get<std::string>();
  const std::string_view file = std::string_view(name).substr(std::min(kFolder.size(), name.size()));
  const bool is_plain = std::all_of(file.begin(), file.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.';
  });
  if (name.starts_with(kFolder) && is_plain && file.ends_with(".h5") && !file.starts_with('.')) return name;
  throw std::runtime_error(
      fmt::format("the list of shards names {}, expected \"shards/\" and a name of letters, digits, \"_\", "
                  "\"-\" and \".\" that ends in \".h5\"",
                  value.dump()));
}

std::vector<ListedShard> read_listed_shards(const std::filesystem::path& file) {
  const ordered_json document = read_dataset_document(file);
  try {
    std::vector<ListedShard> shards;
    for (const ordered_json& shard : document.at("shards")) {
      shards.push_back({shard_name(shard.at("file")), shard.at("sha256").get<std::string>()});
    }
    return shards;
  } catch (const std::exception& error) {  // from the JSON library or from shard_name()
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace q3d::manifests
