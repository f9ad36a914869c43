#include "pipeline/config/settings_page.h"

#include <algorithm>
#include <stdexcept>

#include "pipeline/config/build_settings.h"

namespace q3d::pipeline::config {
namespace {

const std::string kBegin = "<!-- settings: ";
const std::string kEndOfBegin = " -->\n";
const std::string kEnd = "<!-- end of settings -->\n";

std::string default_text(const SettingFacts& facts) {
  if (facts.is_required) return "required";
  if (facts.value.is_null()) return "none";
  if (facts.value.is_string()) return "`" + facts.value.get<std::string>() + "`";
  return fmt::format("{}", facts.value.dump());
}

std::string limits_text(const SettingFacts& facts) {
  std::string text;
  for (const std::string& word : facts.words) text += (text.empty() ? "`" : ", `") + word + "`";
  return text.empty() ? facts.range.text() : text;
}

std::string type_text(const SettingFacts& facts) {
  return facts.type == "array" ? "list of strings" : facts.type;
}

std::string table(const std::vector<SettingFacts>& settings) {
  std::string text = "| key | type | default | values | meaning |\n|---|---|---|---|---|\n";
  for (const SettingFacts& facts : settings) {
    text += fmt::format("| `{}` | {} | {} | {} | {} |\n", facts.key, type_text(facts), default_text(facts),
                        limits_text(facts), facts.description);
  }
  return text;
}

}  // namespace

SettingsTables build_settings_tables() {
  return {{"build", facts_of(build_settings())},
          {"datasets", facts_of(dataset_settings())},
          {"own labels", facts_of(own_label_settings())},
          {"network", facts_of(network_settings())},
          {"tta", facts_of(tta_settings())},
          {"filter", facts_of(filter_settings())},
          {"guards", facts_of(guard_settings())},
          {"shards", facts_of(shard_settings())},
          {"leakage", facts_of(leakage_settings())},
          {"calibrate", facts_of(calibrate_settings())}};
}

bool has_settings_table(const std::string& page, const SettingsTables& tables) {
  return std::any_of(tables.begin(), tables.end(), [&](const auto& entry) {
    return page.find(kBegin + entry.first + kEndOfBegin) != std::string::npos;
  });
}

std::string with_settings_tables(const std::string& page, const SettingsTables& tables) {
  SettingsTables missing = tables;
  std::string result;
  std::size_t at = 0;
  while (true) {
    const std::size_t begin = page.find(kBegin, at);
    if (begin == std::string::npos) break;
    const std::size_t after_name = page.find(kEndOfBegin, begin);
    const std::size_t end = page.find(kEnd, begin);
    if (after_name == std::string::npos || end == std::string::npos) {
      throw std::runtime_error("a table of settings has no line \"<!-- end of settings -->\"");
    }
    const std::string name = page.substr(begin + kBegin.size(), after_name - begin - kBegin.size());
    const auto found = missing.find(name);
    if (found == missing.end()) throw std::runtime_error("no settings are called \"" + name + "\", or twice");
    result += page.substr(at, after_name + kEndOfBegin.size() - at) + table(found->second) + kEnd;
    missing.erase(found);
    at = end + kEnd.size();
  }
  if (!missing.empty())
    throw std::runtime_error("the page has no table of the settings of " + missing.begin()->first);
  return result + page.substr(at);
}

}  // namespace q3d::pipeline::config
