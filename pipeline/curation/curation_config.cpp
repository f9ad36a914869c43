#include "pipeline/curation/curation_config.h"

#include <fmt/format.h>

#include <set>

#include "loaders/species/species.h"
#include "pipeline/config/config_layers.h"
#include "pipeline/config/json_fields.h"

namespace q3d::pipeline::curation {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

void require(bool holds, const std::string& where, const std::string& what) {
  if (!holds) throw run::ConfigError(where + ": " + what);
}

// Reads a list of at least one text, none of them empty.
std::vector<std::string> parse_texts(const json& list, const std::string& where) {
  require(list.is_array() && !list.empty(), where, "must be a list of texts, got " + list.dump());
  std::vector<std::string> texts;
  for (const json& text : list) {
    require(text.is_string() && !text.get_ref<const std::string&>().empty(), where,
            "must be a list of texts, got " + text.dump() + " in it");
    texts.push_back(text.get<std::string>());
  }
  return texts;
}

std::map<std::string, std::vector<std::string>> parse_species(const json& object, const std::string& where) {
  require(object.is_object() && !object.empty(), where,
          "must be an object from a species to the names that count as it");
  std::map<std::string, std::vector<std::string>> species;
  for (const auto& [name, names] : object.items()) {
    require(name == loaders::species::normalised_species(name) && !name.empty(), where,
            fmt::format("\"{}\": a species is written in lower case, with spaces", name));
    species[name] = parse_texts(names, where + ": " + name);
  }
  return species;
}

std::map<std::string, std::int64_t> parse_pictures(const json& object, const std::string& where) {
  require(object.is_object() && !object.empty(), where, "must be an object from a split to a number");
  std::map<std::string, std::int64_t> pictures;
  for (const auto& [split, count] : object.items()) {
    require(count.is_number_integer() && count.get<std::int64_t>() > 0, where,
            fmt::format("\"{}\" must be a whole number greater than 0, got {}", split, count.dump()));
    pictures[split] = count.get<std::int64_t>();
  }
  return pictures;
}

std::vector<CurationSource> parse_sources(const json& list, const std::string& where) {
  require(list.is_array(), where, "must be a list of objects");
  std::vector<CurationSource> sources;
  for (std::size_t i = 0; i < list.size(); ++i) {
    CurationSource& source = sources.emplace_back();
    config::JsonFields fields(list[i], fmt::format("{}[{}]", where, i));
    fields.require("source", source.source);
    const json* annotations = fields.child("annotations");
    require(annotations != nullptr, fields.where(), "the key \"annotations\" is missing");
    for (std::string& file : parse_texts(*annotations, fields.where() + ": annotations")) {
      source.annotations.emplace_back(std::move(file));
    }
    fields.finish();
  }
  return sources;
}

void resolve_paths(json& config, const fs::path& folder) {
  config::resolve_dataset_paths(config, "datasets", folder);
  if (!config.contains("sources") || !config["sources"].is_array()) return;
  for (json& source : config["sources"]) {
    if (!source.is_object() || !source.contains("annotations") || !source["annotations"].is_array()) continue;
    for (json& file : source["annotations"]) {
      if (file.is_string()) file = (folder / file.get<std::string>()).lexically_normal().string();
    }
  }
}

// Checks that each split has one dataset and one number, so that no dataset is ignored by mistake.
void check_splits(const CurationConfig& config, const std::string& where) {
  std::set<std::string> splits;
  for (const config::DatasetConfig& dataset : config.datasets) {
    require(splits.insert(dataset.split).second, where + ": datasets",
            "two have the split \"" + dataset.split + "\"; a list is of one set, cut into splits");
    require(config.rule.pictures.contains(dataset.split), where + ": pictures",
            "the split \"" + dataset.split + "\" has no number");
    require(dataset.curation.empty(), where + ": datasets", "\"curation\" is what this makes");
  }
  for (const auto& [split, count] : config.rule.pictures) {
    require(splits.contains(split), where + ": pictures", "no dataset has the split \"" + split + "\"");
  }
}

}  // namespace

CurationConfig parse_curation_config(const json& merged, const std::string& where) {
  CurationConfig config;
  config::JsonFields fields(merged, where);
  const auto child = [&](const char* key) -> const json& {
    const json* found = fields.child(key);
    require(found != nullptr, where, fmt::format("the key \"{}\" is missing", key));
    return *found;
  };
  fields.read("name", config.name);
  config.datasets = config::parse_datasets(child("datasets"), where + ": datasets");
  if (const json* sources = fields.child("sources")) {
    config.sources = parse_sources(*sources, where + ": sources");
  }
  if (const json* videos = fields.child("videos")) {
    config.videos = parse_texts(*videos, where + ": videos");
  }
  config.rule.species = parse_species(child("species"), where + ": species");
  config.rule.pictures = parse_pictures(child("pictures"), where + ": pictures");
  std::optional<int> cap;
  fields.read("cap", cap);
  fields.read("seed", config.rule.seed);
  fields.finish();
  require(!cap || *cap > 0, where, "\"cap\" must be greater than 0");
  if (cap) config.rule.cap = *cap;
  constexpr const char* kPlain = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-";
  require(!config.name.empty() && config.name.find_first_not_of(kPlain) == std::string::npos, where,
          "\"name\" becomes a file's name: letters, digits, '.', '_' and '-' only");
  require(!config.datasets.empty(), where, "\"datasets\" must name at least one dataset");
  check_splits(config, where);
  config.as_written = merged;
  return config;
}

CurationConfig load_curation_config(const std::vector<fs::path>& files,
                                    const std::vector<std::string>& settings) {
  config::ConfigLayers layers = config::read_config_layers(files, resolve_paths, settings);
  CurationConfig config = parse_curation_config(layers.resolved, layers.where);
  config.as_written = std::move(layers.as_written);
  return config;
}

}  // namespace q3d::pipeline::curation
