#include "pipeline/config/settings_page.h"

#include <map>
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

std::string table(const std::vector<SettingFacts>& settings) {
  std::string text = "| key | type | default | values | meaning |\n|---|---|---|---|---|\n";
  for (const SettingFacts& facts : settings) {
    text += fmt::format("| `{}` | {} | {} | {} | {} |\n", facts.key, facts.type, default_text(facts),
                        limits_text(facts), facts.description);
  }
  return text;
}

std::map<std::string, std::string> tables() {
  return {{"build", table(facts_of(build_settings()))},
          {"datasets", table(facts_of(dataset_settings()))},
          {"own labels", table(facts_of(own_label_settings()))},
          {"network", table(facts_of(network_settings()))},
          {"tta", table(facts_of(tta_settings()))},
          {"filter", table(facts_of(filter_settings()))},
          {"guards", table(facts_of(guard_settings()))},
          {"shards", table(facts_of(shard_settings()))},
          {"leakage", table(facts_of(leakage_settings()))},
          {"calibrate", table(facts_of(calibrate_settings()))}};
}

}  // namespace

std::string with_settings_tables(const std::string& page) {
  std::map<std::string, std::string> missing = tables();
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
    result += page.substr(at, after_name + kEndOfBegin.size() - at) + found->second + kEnd;
    missing.erase(found);
    at = end + kEnd.size();
  }
  if (!missing.empty())
    throw std::runtime_error("the page has no table of the settings of " + missing.begin()->first);
  return result + page.substr(at);
}

}  // namespace q3d::pipeline::config
