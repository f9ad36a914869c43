#include "model/partial_mean.h"

namespace q3d::model {

void join_means(const std::vector<PartialMean*>& means, const ranks::Collective& ranks) {
  if (ranks.size() == 1) return;
  std::vector<torch::Tensor> counts;
  for (const PartialMean* mean : means) counts.push_back(mean->count);
  const torch::Tensor joint = ranks.sum(torch::stack(counts));
  for (std::size_t i = 0; i < means.size(); ++i) {
    means[i]->sum = means[i]->sum * ranks.size();
    means[i]->count = joint[static_cast<std::int64_t>(i)];
  }
}

}  // namespace q3d::model
