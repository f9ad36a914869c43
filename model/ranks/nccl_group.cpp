// The one file that sees the headers of NCCL and CUDA, which LibTorch's wheel brings along
// (cmake/FindLibTorch.cmake).
#include "model/ranks/nccl_group.h"

#include <stdexcept>

#ifdef Q3D_NCCL
#define USE_C10D_NCCL
#include <ATen/cuda/CUDAContext.h>

#include <torch/csrc/distributed/c10d/PrefixStore.hpp>
#include <torch/csrc/distributed/c10d/ProcessGroupNCCL.hpp>
#endif

namespace q3d::model::ranks {

#ifdef Q3D_NCCL

bool can_use_nccl(const RankPlace& place, torch::Device device) {
  return device.is_cuda() && place.local_size <= static_cast<int>(at::cuda::device_count());
}

c10::intrusive_ptr<c10d::Backend> open_nccl(const RankPlace& place,
                                            const c10::intrusive_ptr<c10d::Store>& store) {
  const auto options = c10d::ProcessGroupNCCL::Options::create();
  options->timeout = place.answer_timeout;
  return c10::make_intrusive<c10d::ProcessGroupNCCL>(c10::make_intrusive<c10d::PrefixStore>("nccl", store),
                                                     place.rank, place.size, options);
}

#else

bool can_use_nccl(const RankPlace&, torch::Device) {
  return false;
}

c10::intrusive_ptr<c10d::Backend> open_nccl(const RankPlace&, const c10::intrusive_ptr<c10d::Store>&) {
  throw std::runtime_error("this program was built without NCCL");
}

#endif

}  // namespace q3d::model::ranks
