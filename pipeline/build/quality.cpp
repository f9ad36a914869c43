#include "pipeline/build/quality.h"

#include <fmt/format.h>

#include <stdexcept>

namespace q3d::pipeline::build {
namespace {

using dataset::Warning;
using dataset::WarningKind;

// The advice for a person who has photographs.
constexpr const char* kForPhotographs =
    "For photographs import the official weights and SMAL (docs/assets.md), or train a network on "
    "photographs";

std::string above_ceiling(const PoolErrors& pool, double tau_ceiling) {
  return fmt::format(
      "the dataset {} is labelled with tau_high = {:.4g}, above filter.tau_ceiling = {:.4g}: labels may lie "
      "further from the annotated keypoints than chance would put them",
      pool.dataset, pool.tau_high, tau_ceiling);
}

std::string outside_domain(const PoolErrors& pool, double median, double bound,
                           const device::NetworkDomain& domain) {
  return fmt::format(
      "half of the {} predictions for the dataset {} have an L_proj above {:.4f}, but 95 % of the pictures "
      "that the network was tested on ({}) lie below {:.4f}: the network does not know such pictures, and "
      "its labels are not to be trusted",
      pool.errors.size(), pool.dataset, median, domain.held_out, bound);
}

}  // namespace

std::vector<Warning> quality_warnings(const std::vector<PoolErrors>& pools, const Origins& origins,
                                      double tau_ceiling) {
  std::vector<Warning> warnings;
  const auto warn = [&](WarningKind kind, auto&& message_of) {
    for (const PoolErrors& pool : pools) {
      const std::string message = message_of(pool);
      if (!message.empty()) warnings.push_back({kind, pool.dataset, message});
    }
  };
  warn(WarningKind::above_ceiling, [&](const PoolErrors& pool) {
    return pool.tau_high > tau_ceiling ? above_ceiling(pool, tau_ceiling) : std::string();
  });
  warn(WarningKind::outside_domain, [&](const PoolErrors& pool) {
    const std::optional<double> bound = device::quantile(origins.domain, 0.95);
    if (!bound || pool.errors.empty()) return std::string();
    const double median = device::quantiles_of(pool.errors, {0.5}).front().l_proj;
    return median > *bound ? outside_domain(pool, median, *bound, origins.domain) : std::string();
  });
  warn(WarningKind::rendered_network, [&](const PoolErrors& pool) {
    if (pool.is_rendered || origins.domain.pictures != device::Pictures::rendered) return std::string();
    return fmt::format(
        "the pictures of the dataset {} count as photographs, and the network has seen rendered pictures "
        "alone ({}): its labels of photographs are not to be trusted. {}",
        pool.dataset, origins.domain.trained_on, kForPhotographs);
  });
  warn(WarningKind::rendered_body, [&](const PoolErrors& pool) {
    if (pool.is_rendered || !origins.has_rendered_body) return std::string();
    return fmt::format(
        "the pictures of the dataset {} count as photographs, and the body model is the synthetic quadruped "
        "of the rendered world, which is not SMAL and has the shape of no animal. {}",
        pool.dataset, kForPhotographs);
  });
  return warnings;
}

void require_below_ceiling(const std::string& dataset, double tau_high, double tau_ceiling) {
  if (tau_high <= tau_ceiling) return;
  throw std::runtime_error(fmt::format(
      "tau_high{} is {:.4g}, above filter.tau_ceiling = {:.4g} crop units: nothing is published, because a "
      "prediction that lies so far from the annotated keypoints is hardly better than a guess, and "
      "adaptation cannot make a label of it. Most often the network does not know such pictures, or the "
      "annotations are wrong (swapped sides, another picture, another order of the keypoints). Look at some "
      "of them with `inspect` and `explain`. A smaller share of labels (calibrate.refined) gives a lower "
      "tau_high; --above-ceiling goes on all the same",
      dataset.empty() ? "" : fmt::format(" of the dataset {}", dataset), tau_high, tau_ceiling));
}

config::JudgingRules checked_rules(const config::BuildConfig& config, bool above_ceiling) {
  config::require_keypoints(config);
  config::JudgingRules rules = config::judging_rules(config);
  if (above_ceiling) return rules;
  for (const auto& [name, thresholds] : rules.thresholds) {
    require_below_ceiling(name, thresholds.tau_high, config.filter.tau_ceiling);
  }
  return rules;
}

void require_labels(const dataset::DatasetManifest& manifest, const std::filesystem::path& folder,
                    double max_failed_share) {
  const dataset::Counts& counts = manifest.counts;
  const bool has_labels = counts.retained + counts.refined > 0;
  const auto most_failed = max_failed_share * static_cast<double>(counts.candidates);
  if (has_labels && static_cast<double>(counts.failed) <= most_failed) return;
  std::string reasons;
  for (const auto& [reason, count] : manifest.reasons) {
    reasons += fmt::format("{}{} {}", reasons.empty() ? "" : ", ", manifests::to_string(reason), count);
  }
  const bool all_failed = counts.candidates > 0 && counts.failed == counts.candidates;
  std::string outcome = "there are no candidates: the annotation files list no animal";
  if (counts.candidates > 0) {
    outcome = all_failed ? fmt::format("all {} candidates failed", counts.candidates)
                         : fmt::format("of {} candidates {} were discarded and {} failed", counts.candidates,
                                       counts.discarded, counts.failed);
  }
  const std::string what =
      has_labels ? fmt::format(
                       "{} of {} candidates failed, which is more than the share of max_failed_share "
                       "= {:g}: most often pictures are not where the config looks for them",
                       counts.failed, counts.candidates, max_failed_share)
                 : "no label was kept: " + outcome;
  throw std::runtime_error(fmt::format(
      "{}{}. `latest` stays as it was; {} lists every candidate with its reason, `quadruped3d explain` tells "
      "one's whole story, and docs/troubleshooting.md says what to do about each reason",
      what, reasons.empty() ? "" : " (" + reasons + ")", (folder / "verdicts.csv").string()));
}

}  // namespace q3d::pipeline::build
