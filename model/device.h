// Chooses and configures the device. No other file of the model names CUDA.
#pragma once

#include <torch/types.h>

#include <string>

namespace q3d::model {

struct DeviceChoice {
  torch::Device device = torch::kCPU;
  std::string description;  // "cpu (2 threads)", "cuda:0 NVIDIA H100 80GB HBM3"
  std::string warning;      // a GPU that is present but cannot be used, and why; else empty
};

// "auto" (a usable GPU, else the CPU), "cpu", "cuda", "cuda:I". If several processes run on a machine,
// numbered by local_rank, "auto" and "cuda" give each the GPU local_rank modulo the number of GPUs. Throws
// std::invalid_argument for another word and std::runtime_error when a CUDA device was asked for and cannot
// be used.
DeviceChoice choose_device(const std::string& name, int local_rank = 0);

// Describes what decides the last bits of a result on this device: the CPU's vendor, its instruction sets,
// the one that LibTorch's own kernels use, limits that the environment sets for oneDNN and MKL, or the GPU's
// model; and LibTorch's version. Equal texts promise equal bits at equal thread counts. Examples: "intel
// avx512_bf16, kernels AVX512, packed matrices, LibTorch 2.11.0", "NVIDIA H200, LibTorch 2.11.0".
std::string arithmetic_of(const DeviceChoice& choice);

// Selects reproducible kernels, sets the number of threads of a CPU operator, and keeps freed memory in the
// process instead of returning it to the system between batches.
void configure_compute(int threads);

// While one lives, memory that is freed goes back to the system, which configure_compute otherwise prevents.
// Weights that are packed matrix by matrix leave gaps into which no packed matrix fits; kept, they would
// double the memory.
class ReturnFreedMemory {
 public:
  ReturnFreedMemory();
  ~ReturnFreedMemory();
  ReturnFreedMemory(const ReturnFreedMemory&) = delete;
  ReturnFreedMemory& operator=(const ReturnFreedMemory&) = delete;
};

}  // namespace q3d::model
