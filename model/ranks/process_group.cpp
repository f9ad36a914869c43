// Beside tcp_store.h, the one file that sees c10d. The wheel holds gloo but not its headers, which Debian's
// libgloo-dev supplies. They are older than the wheel's gloo, so nothing here touches a gloo type but through
// c10d, and no libgloo is linked.
#include "model/ranks/process_group.h"

#define USE_C10D_GLOO
#include <fmt/format.h>
#include <torch/version.h>

#include <torch/csrc/distributed/c10d/ProcessGroup.hpp>
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#include <torch/csrc/distributed/c10d/reducer.hpp>

#include <algorithm>
#include <stdexcept>

#include "model/ranks/nccl_group.h"
#include "model/ranks/tcp_store.h"

namespace q3d::model::ranks {
namespace {

static_assert(TORCH_VERSION_MAJOR == 2 && TORCH_VERSION_MINOR == 11,
              "c10d's classes are no stable interface: check the calls here against another LibTorch");

using GroupPointer = c10::intrusive_ptr<c10d::ProcessGroup>;

// Adds the rank to the message of an error, because all ranks write to one terminal.
template <typename Call>
auto together(const RankPlace& place, Call&& call) {
  try {
    return call();
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format(
        "rank {} of {}: working with the other ranks failed (where one of them has ended, its own "
        "message says why): {}",
        place.rank, place.size, first_line(error)));
  }
}

// Keeps two of the reducer's warnings from users, for whom they mean nothing. It searches for parameters that
// no loss reaches, which networks without keypoint tokens have, and warns when there are none. And it warns
// when the strides of a gradient of a 1x1 convolution, which oneDNN computes, differ from the weight's; the
// order in memory is the same.
class ReducerWarnings : public c10::WarningHandler {
 public:
  void process(const c10::Warning& warning) override {
    for (const char* known :
         {"find_unused_parameters=True was specified", "Grad strides do not match bucket view strides"}) {
      if (warning.msg().find(known) != std::string::npos) return;
    }
    c10::WarningHandler::process(warning);
  }
};

class ReducedBackward : public AveragedBackward {
 public:
  ReducedBackward(const RankPlace& place, const GroupPointer& group,
                  const std::vector<torch::Tensor>& parameters)
      : place_(place) {
    const std::vector<bool> sparse(parameters.size(), false);
    auto [buckets, limits] = c10d::compute_bucket_assignment_by_size(
        parameters, {c10d::kDefaultFirstBucketBytes, c10d::kDefaultBucketBytesCap}, sparse);
    // Gradients come from the last layer to the first.
    std::reverse(buckets.begin(), buckets.end());
    reducer_ = std::make_unique<c10d::Reducer>(
        parameters, std::move(buckets), group, sparse, c10d::kDefaultBucketBytesCap,
        /*find_unused_parameters=*/true, /*gradient_as_bucket_view=*/false,
        std::unordered_map<std::size_t, std::string>{}, c10d::kDefaultFirstBucketBytes,
        /*skip_all_reduce_unused_params=*/false, /*use_python_reducer=*/false, std::vector<std::int64_t>{});
  }

  void run(const torch::Tensor& loss) override {
    together(place_, [&] {
      ReducerWarnings warnings;
      const c10::WarningUtils::WarningHandlerGuard guard(&warnings);
      reducer_->prepare_for_backward({loss});
      loss.backward();
    });
  }

 private:
  RankPlace place_;
  std::unique_ptr<c10d::Reducer> reducer_;
};

struct Group {
  GroupPointer pointer;
  std::string transport;  // of tensors on the device
};

class Ranks : public Collective {
 public:
  Ranks(RankPlace place, Group group)
      : place_(std::move(place)), group_(std::move(group.pointer)), transport_(std::move(group.transport)) {}

  int rank() const override { return place_.rank; }
  int size() const override { return place_.size; }
  std::string transport() const override { return transport_; }

  torch::Tensor sum(const torch::Tensor& tensor) const override {
    return together(place_, [&] {
      std::vector<torch::Tensor> tensors{tensor.detach().clone()};
      group_->allreduce(tensors)->wait();
      return tensors.front();
    });
  }

  torch::Tensor gather(const torch::Tensor& rows) const override {
    std::vector<torch::Tensor> own{rows.detach().contiguous()};
    std::vector<std::vector<torch::Tensor>> parts(1);
    for (int rank = 0; rank < size(); ++rank) parts[0].push_back(torch::empty_like(own.front()));
    together(place_, [&] { return group_->allgather(parts, own)->wait(); });
    torch::Tensor& mine = parts[0][static_cast<std::size_t>(rank())];
    if (rows.requires_grad()) {
      mine = rows.clone();
      mine.register_hook([ranks = size()](const torch::Tensor& gradient) { return gradient * ranks; });
    }
    return torch::cat(parts[0]);
  }

  std::unique_ptr<AveragedBackward> averaged_backward(
      const std::vector<torch::Tensor>& parameters) const override {
    return std::make_unique<ReducedBackward>(place_, group_, parameters);
  }

 private:
  RankPlace place_;
  GroupPointer group_;
  std::string transport_;
};

// Returns whether all ranks of the group say yes.
bool all_say(const GroupPointer& group, bool yes) {
  std::vector<torch::Tensor> words{torch::tensor({yes ? 1 : 0})};
  c10d::AllreduceOptions options;
  options.reduceOp = c10d::ReduceOp::MIN;
  group->allreduce(words, options)->wait();
  return words.front().item<int>() == 1;
}

// Gloo for tensors on the CPU. For those on GPUs NCCL, or Gloo over a copy on the host where not every rank
// can use NCCL.
Group open_group(const RankPlace& place, torch::Device device) {
  const auto store = open_tcp_store(place, "training", Gathering::together);
  // The interface is that of the host's name, or GLOO_SOCKET_IFNAME.
  const auto options = c10d::ProcessGroupGloo::Options::create_default(place.join_timeout);
  const auto gloo = c10::make_intrusive<c10d::ProcessGroupGloo>(store, place.rank, place.size, options);
  gloo->setTimeout(place.answer_timeout);
  auto group = c10::make_intrusive<c10d::ProcessGroup>(store, place.rank, place.size);
  group->setBackend(torch::kCPU, c10d::ProcessGroup::BackendType::GLOO, gloo);
  group->setDefaultBackend(c10d::ProcessGroup::BackendType::GLOO);
  const bool has_nccl = all_say(group, can_use_nccl(place, device));
  if (has_nccl) {
    group->setBackend(device.type(), c10d::ProcessGroup::BackendType::NCCL, open_nccl(place, store));
  } else if (!device.is_cpu()) {
    group->setBackend(device.type(), c10d::ProcessGroup::BackendType::GLOO, gloo);
  }
  return {group, has_nccl ? "NCCL" : "Gloo"};
}

}  // namespace

std::shared_ptr<const Collective> join_ranks(const RankPlace& place, torch::Device device) {
  if (place.size == 1) return single_rank();
  try {
    return std::make_shared<Ranks>(place, open_group(place, device));
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("rank {} of {}: the ranks did not meet at {}:{} within {} s: {}",
                                         place.rank, place.size, place.master_address, place.master_port,
                                         place.join_timeout.count(), first_line(error)));
  }
}

}  // namespace q3d::model::ranks
