// Without a GPU, these tests see only that NCCL is built in, is not chosen, and says that it lacks a GPU.
#include "model/ranks/nccl_group.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/cuda.h>

#include <torch/csrc/distributed/c10d/HashStore.hpp>

namespace q3d::model::ranks {
namespace {

RankPlace two_ranks() {
  RankPlace place;
  place.size = place.local_size = 2;
  return place;
}

TEST(Nccl, IsNotChosenOnACpuNorForMoreRanksThanGpus) {
  EXPECT_FALSE(can_use_nccl(two_ranks(), torch::kCPU));
  RankPlace crowded = two_ranks();
  crowded.local_size = static_cast<int>(torch::cuda::device_count()) + 1;
  EXPECT_FALSE(can_use_nccl(crowded, torch::kCUDA));
}

TEST(Nccl, IsBuiltInAndNeedsAGpu) {
  if (torch::cuda::is_available()) GTEST_SKIP() << "there is a GPU";
  try {
    open_nccl(two_ranks(), c10::make_intrusive<c10d::HashStore>());
    FAIL() << "NCCL was opened without a GPU";
  } catch (const std::exception& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("no GPUs found"));
  }
}

}  // namespace
}  // namespace q3d::model::ranks
