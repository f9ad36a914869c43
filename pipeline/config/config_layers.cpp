#include "pipeline/config/config_layers.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "manifests/file_descriptor.h"
#include "manifests/json_keys.h"
#include "manifests/spelling.h"
#include "manifests/text_file.h"
#include "pipeline/config/config_override.h"
#include "pipeline/config/json_depth.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::config {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr std::uint64_t kMaxConfigBytes = 64U << 20U;

json read_json(const fs::path& file) {
  try {
    const std::string text = manifests::read_text_file(file, "a config in JSON", kMaxConfigBytes);
    return json::parse(text, manifests::refuse_repeated_keys<json>(refuse_depth(file.string())), true,
                       /*ignore_comments=*/true);
  } catch (const manifests::RepeatedKey& error) {
    throw run::ConfigError(fmt::format("{}: {}", file.string(), error.what()));
  } catch (const json::exception& error) {  // also numbers beyond double, which are no parse_error
    throw run::ConfigError(fmt::format("{}: not valid JSON: {}", file.string(), error.what()));
  } catch (const manifests::IoError&) {
    throw;
  } catch (const run::ConfigError&) {
    throw;
  } catch (const std::runtime_error& error) {  // there is no such file, or it is no text
    throw run::ConfigError(error.what());
  }
}

}  // namespace

ConfigLayers read_config_layers(const std::vector<fs::path>& files,
                                const std::function<void(json&, const fs::path&)>& resolve_paths,
                                const std::vector<std::string>& settings) {
  ConfigLayers layers{json::object(), json::object(), {}};
  for (const fs::path& file : files) {
    json layer = read_json(file);
    if (!layer.is_object())
      throw run::ConfigError(file.string() + ": expected a JSON object at the top level");
    layers.as_written.merge_patch(layer);
    resolve_paths(layer, fs::absolute(file).parent_path());
    layers.resolved.merge_patch(layer);
    layers.where += (layers.where.empty() ? "" : " + ") + file.string();
  }
  for (const std::string& setting : settings) {
    apply_override(parse_override(setting), resolve_paths, fs::current_path(), layers.resolved,
                   layers.as_written);
  }
  if (!settings.empty()) layers.where += layers.where.empty() ? "--set" : " + --set";
  return layers;
}

void resolve_path(json& object, const char* key, const fs::path& folder) {
  if (object.is_object() && object.contains(key) && object[key].is_string()) {
    object[key] = (folder / object[key].get<std::string>()).lexically_normal().string();
  }
}

void require_one_of(const std::string& value, const std::vector<std::string>& known,
                    const std::string& where) {
  if (std::find(known.begin(), known.end(), value) != known.end()) return;
  std::string list;
  for (const auto& word : known) list += (list.empty() ? "" : ", ") + word;
  throw run::ConfigError(fmt::format("{}: \"{}\" is not known; expected one of: {}. Did you mean \"{}\"?",
                                     where, value, list, manifests::nearest_word(value, known)));
}

}  // namespace q3d::pipeline::config
