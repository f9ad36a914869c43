#include "pipeline/stages/plan_difference.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>
#include <set>

namespace q3d::pipeline::stages {
namespace {

using nlohmann::json;

constexpr std::size_t kDigestDigits = 64;

// Formats a value for people: a digest by its first digits, an absent value as "nothing".
std::string shown(const json& value) {
  if (value.is_null()) return "nothing";
  if (value.is_string()) {
    const auto& text = value.get_ref<const std::string&>();
    return text.size() == kDigestDigits ? text.substr(0, kShortKey) : text;
  }
  return value.dump();
}

json parts_of(const BuildPlan& plan, Stage stage) {
  return json::parse(plan.made_from.at(std::string(to_string(stage))));
}

// Compares the members of two objects recursively.
void compare(const json& before, const json& after, const std::string& prefix,
             std::vector<std::string>& list) {
  std::set<std::string> names;
  for (const json* side : {&before, &after}) {
    for (const auto& item : side->items()) names.insert(item.key());
  }
  for (const std::string& name : names) {
    const json old = before.value(name, json());
    const json now = after.value(name, json());
    if (old == now) continue;
    if (old.is_object() && now.is_object()) {
      compare(old, now, prefix + name + ".", list);
    } else if (old.is_array() || now.is_array()) {
      list.push_back(fmt::format("{}{}: other values", prefix, name));
    } else {
      list.push_back(fmt::format("{}{}: {} -> {}", prefix, name, shown(old), shown(now)));
    }
  }
}

}  // namespace

std::vector<std::string> differences(const BuildPlan& before, const BuildPlan& after, Stage stage) {
  std::vector<std::string> list;
  json old = parts_of(before, stage);
  json now = parts_of(after, stage);
  std::vector<std::string> earlier;
  for (const std::string_view name : stage_names()) {
    const std::string member(name);
    if (!old.contains(member) && !now.contains(member)) continue;
    const bool differs = old.value(member, json()) != now.value(member, json());
    old.erase(member);
    now.erase(member);
    if (!differs) continue;
    const Stage other = stage_from_string(member);
    if (has_folder(other) || !before.made_from.contains(member) || !after.made_from.contains(member)) {
      earlier.push_back(fmt::format("the stage {} before it is another", member));
    } else {
      const std::vector<std::string> own = differences(before, after, other);
      earlier.insert(earlier.end(), own.begin(), own.end());
    }
  }
  compare(old, now, "", list);
  list.insert(list.end(), earlier.begin(), earlier.end());
  return list;
}

std::optional<BuildPlan> nearest_plan(const std::vector<BuildPlan>& plans, const BuildPlan& plan, Stage stage,
                                      const std::string& preferred) {
  const BuildPlan* nearest = nullptr;
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (const BuildPlan& each : plans) {
    if (!each.made_from.contains(std::string(to_string(stage)))) continue;
    const std::size_t count = differences(each, plan, stage).size();
    const bool has_preferred = nearest != nullptr && version_name(nearest->name, nearest->keys) == preferred;
    if (count > least || (count == least && has_preferred)) continue;
    nearest = &each;
    least = count;
  }
  return nearest == nullptr ? std::nullopt : std::optional(*nearest);
}

}  // namespace q3d::pipeline::stages
