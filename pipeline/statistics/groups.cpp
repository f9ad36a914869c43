#include "pipeline/statistics/groups.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "manifests/enumerators.h"
#include "pipeline/dataset/sentences.h"
#include "pipeline/statistics/numbers.h"

namespace q3d::pipeline::statistics {
namespace {

using manifests::Verdict;
using nlohmann::ordered_json;

struct Mean {
  double sum = 0.0;
  std::int64_t count = 0;
  void add(double value) {
    if (!std::isfinite(value)) return;
    sum += value;
    ++count;
  }
  ordered_json json() const {
    return count > 0 ? rounded(sum / static_cast<double>(count)) : ordered_json(nullptr);
  }
};

struct Group {
  dataset::Counts counts;
  std::map<manifests::Family, std::int64_t> families;
  Mean before, after;
  std::int64_t kept() const { return counts.retained + counts.refined; }
  manifests::Family family() const {
    return std::max_element(families.begin(), families.end(),
                            [](const auto& a, const auto& b) { return a.second < b.second; })
        ->first;
  }
};
using Groups = std::map<std::string, Group>;

Groups grouped(const Facts& facts, const std::function<std::string(const dataset::VerdictRow&)>& name_of) {
  Groups groups;
  for (const CandidateFacts& candidate : facts.candidates) {
    const std::string name = name_of(candidate.row);
    Group& group = groups[name.empty() ? "unknown" : name];
    const manifests::Judgement& judgement = candidate.row.judgement;
    group.counts.add(judgement.verdict);
    ++group.families[candidate.row.family];
    if (!manifests::is_kept(judgement.verdict)) continue;
    group.before.add(judgement.initial_error);
    group.after.add(judgement.final_error);
  }
  return groups;
}

ordered_json share_json(std::int64_t part, std::int64_t whole) {
  const auto share = share_of(part, whole);
  if (!share) return nullptr;
  return {{"share", rounded(share->share)}, {"low", rounded(share->low)}, {"high", rounded(share->high)}};
}

double ratio(std::int64_t part, std::int64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

// Returns the groups, largest first; groups of equal size are sorted by name.
ordered_json list_of(const Groups& groups, const dataset::Counts& all) {
  std::vector<const Groups::value_type*> order;
  for (const auto& group : groups) order.push_back(&group);
  std::stable_sort(order.begin(), order.end(), [](const auto* a, const auto* b) {
    return a->second.counts.candidates > b->second.counts.candidates;
  });
  ordered_json list = ordered_json::array();
  for (const auto* entry : order) {
    const Group& group = entry->second;
    const dataset::Counts& counts = group.counts;
    list.push_back({{"name", entry->first},
                    {"family", manifests::to_string(group.family())},
                    {"candidates", counts.candidates},
                    {"retained", counts.retained},
                    {"refined", counts.refined},
                    {"discarded", counts.discarded},
                    {"failed", counts.failed},
                    {"kept", group.kept()},
                    {"yield", share_json(group.kept(), counts.candidates)},
                    {"share_before", rounded(ratio(counts.candidates, all.candidates))},
                    {"share_after", rounded(ratio(group.kept(), all.retained + all.refined))},
                    {"mean_error_before", group.before.json()},
                    {"mean_error_after", group.after.json()}});
  }
  return list;
}

// Returns the imbalance. The group of unknown names is not used for it.
ordered_json imbalance(const Groups& groups, const std::string& unnamed) {
  const auto of = [&](const std::function<std::int64_t(const Group&)>& count) -> ordered_json {
    std::int64_t largest = 0, smallest = 0, lost = 0;
    for (const auto& [name, group] : groups) {
      if (name == unnamed) continue;
      const std::int64_t n = count(group);
      if (n == 0) {
        ++lost;
        continue;
      }
      largest = std::max(largest, n);
      smallest = smallest == 0 ? n : std::min(smallest, n);
    }
    const ordered_json factor = smallest == 0 ? ordered_json(nullptr) : rounded(ratio(largest, smallest), 4);
    return {{"largest", largest}, {"smallest", smallest}, {"ratio", factor}, {"lost", lost}};
  };
  return {{"before", of([](const Group& group) { return group.counts.candidates; })},
          {"after", of([](const Group& group) { return group.kept(); })}};
}

dataset::Counts count_all(const Facts& facts) {
  dataset::Counts counts;
  for (const CandidateFacts& candidate : facts.candidates) counts.add(candidate.row.judgement.verdict);
  return counts;
}

}  // namespace

ordered_json funnel(const Facts& facts) {
  std::int64_t usable = 0, admitted = 0, fitting = 0, kept = 0;
  for (const CandidateFacts& candidate : facts.candidates) {
    const manifests::Judgement& judgement = candidate.row.judgement;
    const bool is_kept = manifests::is_kept(judgement.verdict);
    const bool was_left_out =
        judgement.reason == manifests::Reason::vetoed || judgement.reason == manifests::Reason::in_test_split;
    usable += judgement.verdict != Verdict::failed;
    admitted += judgement.verdict != Verdict::failed && !was_left_out;
    fitting += judgement.verdict != Verdict::failed && !was_left_out &&
               judgement.reason != manifests::Reason::error_too_large;
    kept += is_kept;
  }
  return {{{"step", "candidates"},
           {"count", facts.candidates.size()},
           {"meaning", "all annotations that the config names"}},
          {{"step", "usable"}, {"count", usable}, {"meaning", "their record and picture could be read"}},
          {{"step", "admitted"}, {"count", admitted}, {"meaning", "neither vetoed nor in a test set"}},
          {{"step", "near enough"},
           {"count", fitting},
           {"meaning", "L_proj of the prediction is below tau_high, or the label is the file's own"}},
          {{"step", "kept"}, {"count", kept}, {"meaning", "retained or refined"}}};
}

ordered_json reasons(const Facts& facts) {
  std::map<manifests::Reason, std::pair<Verdict, std::int64_t>> counted;
  for (const CandidateFacts& candidate : facts.candidates) {
    const manifests::Judgement& judgement = candidate.row.judgement;
    if (judgement.reason == manifests::Reason::none) continue;
    auto& [verdict, count] = counted[judgement.reason];
    verdict = judgement.verdict;
    ++count;
  }
  std::vector<std::pair<manifests::Reason, std::pair<Verdict, std::int64_t>>> order(counted.begin(),
                                                                                    counted.end());
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.second.second > b.second.second; });
  ordered_json list = ordered_json::array();
  for (const auto& [reason, entry] : order) {
    list.push_back({{"reason", manifests::to_string(reason)},
                    {"verdict", manifests::to_string(entry.first)},
                    {"count", entry.second},
                    {"meaning", dataset::sentence(reason)}});
  }
  return list;
}

ordered_json groups(const Facts& facts) {
  const dataset::Counts all = count_all(facts);
  const Groups species = grouped(facts, [](const dataset::VerdictRow& row) { return row.species; });
  const Groups families = grouped(
      facts, [](const dataset::VerdictRow& row) { return std::string(manifests::to_string(row.family)); });
  const Groups datasets =
      grouped(facts, [](const dataset::VerdictRow& row) { return row.dataset + "/" + row.split; });
  return {{"species", list_of(species, all)},
          {"families", list_of(families, all)},
          {"datasets", list_of(datasets, all)},
          {"imbalance",
           {{"species", imbalance(species, "unknown")},
            {"families", imbalance(families, std::string(manifests::to_string(manifests::Family::none)))}}}};
}

}  // namespace q3d::pipeline::statistics
