#include "pipeline/evaluation/tables.h"

#include <functional>
#include <set>

#include "filters/clustering.h"

namespace q3d::pipeline::evaluation {
namespace {

using manifests::Family;
using manifests::Reason;
using Samples = std::vector<const SampleResult*>;

Samples predicted(const DatasetResult& dataset) {
  Samples samples;
  for (const SampleResult& sample : dataset.samples) {
    if (sample.failure == Reason::none) samples.push_back(&sample);
  }
  return samples;
}

std::vector<const MetricValues*> values_of(const Samples& samples, std::size_t setting) {
  std::vector<const MetricValues*> values;
  for (const SampleResult* sample : samples) values.push_back(&sample->values[setting]);
  return values;
}

class TableMaker {
 public:
  explicit TableMaker(const Evaluation& evaluation) : evaluation_(evaluation) {}

  Tables make() {
    for (const DatasetResult& dataset : evaluation_.datasets) {
      const Samples all = predicted(dataset);
      add_rows(dataset, all, "", all, tables_.datasets);
      std::map<Family, Samples> families;
      std::map<std::string, Samples> species;
      Samples unknown;
      for (const SampleResult* sample : all) {
        // Family::none is the first enumerator, but its row comes last.
        families[sample->family].push_back(sample);
        (sample->species.empty() ? unknown : species[sample->species]).push_back(sample);
      }
      Samples none;
      if (const auto found = families.find(Family::none); found != families.end()) {
        none = std::move(found->second);
        families.erase(found);
      }
      for (const auto& [family, samples] : families) {
        add_rows(dataset, all, std::string(manifests::to_string(family)), samples, tables_.families);
      }
      if (!none.empty()) add_rows(dataset, all, "none", none, tables_.families);
      for (const auto& [name, samples] : species) add_rows(dataset, all, name, samples, tables_.species);
      if (!unknown.empty()) add_rows(dataset, all, "unknown", unknown, tables_.species);
      add_clusters(dataset, all);
    }
    return std::move(tables_);
  }

 private:
  void add_rows(const DatasetResult& dataset, const Samples& all, const std::string& group,
                const Samples& samples, std::vector<TableRow>& rows) const {
    for (std::size_t s = 0; s < evaluation_.settings.size(); ++s) {
      TableRow& row = rows.emplace_back();
      row.dataset = dataset.name;
      row.group = group;
      row.setting = &evaluation_.settings[s];
      row.samples = static_cast<std::int64_t>(samples.size());
      for (const SampleResult* sample : samples) row.by_mask += sample->normalised_by_mask ? 1 : 0;
      const auto values = values_of(samples, s);
      const auto values_of_all = values_of(all, s);
      for (std::size_t m = 0; m < kMetricCount; ++m) {
        const bool zero = evaluation_.options.official_means && mean_of(values_of_all, m).samples > 0;
        row.metrics[m] = mean_of(values, m, zero);
      }
    }
  }

  ClusterRow cluster(const DatasetResult& dataset, const Samples& samples, const Setting* setting,
                     const std::function<const Betas*(const SampleResult&)>& betas_of) const {
    ClusterRow row{dataset.name, setting, 0, 0, std::nullopt};
    std::vector<float> points;
    std::vector<int> families;
    for (const SampleResult* sample : samples) {
      const Betas* betas = betas_of(*sample);
      if (sample->family == Family::none || betas == nullptr) continue;
      points.insert(points.end(), betas->begin(), betas->end());
      families.push_back(static_cast<int>(sample->family));
    }
    row.samples = static_cast<std::int64_t>(families.size());
    row.families = static_cast<std::int64_t>(std::set<int>(families.begin(), families.end()).size());
    if (row.samples >= kShapeClusters) {
      filters::KMeansOptions options;
      options.clusters = kShapeClusters;
      options.seed = evaluation_.options.seed;
      row.ari =
          filters::adjusted_rand_index(filters::k_means(points, manifests::kNumBetas, options), families);
    }
    return row;
  }

  void add_clusters(const DatasetResult& dataset, const Samples& samples) {
    for (std::size_t s = 0; s < evaluation_.settings.size(); ++s) {
      tables_.clusters.push_back(cluster(dataset, samples, &evaluation_.settings[s],
                                         [s](const SampleResult& sample) { return &sample.betas[s]; }));
    }
    ClusterRow truth = cluster(dataset, samples, nullptr, [](const SampleResult& sample) {
      return sample.true_betas ? &*sample.true_betas : nullptr;
    });
    if (truth.samples > 0) tables_.clusters.push_back(std::move(truth));
  }

  const Evaluation& evaluation_;
  Tables tables_;
};

}  // namespace

Tables make_tables(const Evaluation& evaluation) {
  return TableMaker(evaluation).make();
}

}  // namespace q3d::pipeline::evaluation
