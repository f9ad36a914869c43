#include "model/ranks/collective.h"

namespace q3d::model::ranks {
namespace {

class PlainBackward : public AveragedBackward {
 public:
  void run(const torch::Tensor& loss) override { loss.backward(); }
};

class SingleRank : public Collective {
 public:
  int rank() const override { return 0; }
  int size() const override { return 1; }
  std::string transport() const override { return {}; }
  torch::Tensor sum(const torch::Tensor& tensor) const override { return tensor.detach(); }
  torch::Tensor gather(const torch::Tensor& rows) const override { return rows; }
  std::unique_ptr<AveragedBackward> averaged_backward(const std::vector<torch::Tensor>&) const override {
    return std::make_unique<PlainBackward>();
  }
};

}  // namespace

std::shared_ptr<const Collective> single_rank() {
  return std::make_shared<SingleRank>();
}

std::vector<double> mean_over_ranks(const Collective& ranks, const std::vector<double>& values) {
  if (ranks.size() == 1) return values;
  const torch::Tensor mean = ranks.sum(torch::tensor(values, torch::kFloat64)) / ranks.size();
  return {mean.data_ptr<double>(), mean.data_ptr<double>() + mean.numel()};
}

}  // namespace q3d::model::ranks
