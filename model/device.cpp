#include "model/device.h"

#include <ATen/Context.h>
#include <ATen/Parallel.h>
#include <ATen/Version.h>
#include <dlfcn.h>
#include <fmt/format.h>
#include <malloc.h>
#include <torch/cuda.h>
#include <torch/version.h>

#include <array>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>

#include "model/packed_matrix.h"

namespace q3d::model {
namespace {

// Returns the driver's own name of a device. LibTorch's header for it needs a CUDA toolkit; the driver
// library does not, and like LibTorch it respects CUDA_VISIBLE_DEVICES.
std::string cuda_device_name(int index) {
  void* driver = ::dlopen("libcuda.so.1", RTLD_LAZY | RTLD_LOCAL);
  if (driver == nullptr) return "unknown device";
  const auto init = reinterpret_cast<int (*)(unsigned)>(::dlsym(driver, "cuInit"));
  const auto get = reinterpret_cast<int (*)(int*, int)>(::dlsym(driver, "cuDeviceGet"));
  const auto get_name = reinterpret_cast<int (*)(char*, int, int)>(::dlsym(driver, "cuDeviceGetName"));
  std::array<char, 128> name{};
  int device = 0;
  const bool known = init != nullptr && get != nullptr && get_name != nullptr && init(0) == 0 &&
                     get(&device, index) == 0 &&
                     get_name(name.data(), static_cast<int>(name.size()) - 1, device) == 0;
  ::dlclose(driver);
  return known ? std::string(name.data()) : "unknown device";
}

bool nvidia_gpu_present() {
  std::error_code ignored;
  return std::filesystem::exists("/dev/nvidia0", ignored) ||
         std::filesystem::exists("/proc/driver/nvidia/version", ignored);
}

// Returns nothing if the device works, else the reason. It finds out by using the device.
std::optional<std::string> why_unusable(int index) {
  try {
    const torch::Device device(torch::kCUDA, static_cast<torch::DeviceIndex>(index));
    if (torch::ones({2}, torch::TensorOptions(device)).sum().item<float>() == 2.0F) return std::nullopt;
    return "it computes wrong sums";
  } catch (const c10::Error& error) {
    return error.what_without_backtrace();
  } catch (const std::exception& error) {
    return error.what();
  }
}

DeviceChoice cpu_choice() {
  return {torch::kCPU, fmt::format("cpu ({} threads)", at::get_num_threads()), ""};
}

DeviceChoice cuda_choice(int index) {
  return {torch::Device(torch::kCUDA, static_cast<torch::DeviceIndex>(index)),
          fmt::format("cuda:{} {}", index, cuda_device_name(index)), ""};
}

int gpu_of(int local_rank) {
  const torch::DeviceIndex found = torch::cuda::device_count();
  return found > 0 ? local_rank % found : 0;
}

// "cuda" -> `otherwise`, "cuda:3" -> 3, anything else -> nothing.
std::optional<int> cuda_index(const std::string& name, int otherwise) {
  if (name == "cuda") return otherwise;
  if (name.rfind("cuda:", 0) != 0) return std::nullopt;
  int index = -1;
  const char* end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data() + 5, end, index);
  if (error != std::errc{} || stop != end || index < 0 || index > 127) return std::nullopt;
  return index;
}

}  // namespace

DeviceChoice choose_device(const std::string& name, int local_rank) {
  if (name == "cpu") return cpu_choice();
  if (name == "auto") {
    if (!nvidia_gpu_present() && !torch::cuda::is_available()) return cpu_choice();
    const int gpu = gpu_of(local_rank);
    const auto reason = why_unusable(gpu);
    if (!reason) return cuda_choice(gpu);
    DeviceChoice choice = cpu_choice();
    choice.warning = "a GPU is present but cannot be used, so the CPU is: " + *reason;
    return choice;
  }
  const auto index = cuda_index(name, gpu_of(local_rank));
  if (!index) {
    throw std::invalid_argument(
        fmt::format("device '{}' is unknown; use auto, cpu, cuda or cuda:<number>", name));
  }
  if (const auto reason = why_unusable(*index)) {
    throw std::runtime_error(
        fmt::format("device '{}' cannot be used ({} CUDA devices found): {}; use cpu or auto", name,
                    torch::cuda::device_count(), *reason));
  }
  return cuda_choice(*index);
}

namespace {

// Returns the CPU's instruction sets. The libraries choose their matrix kernels by these, and each kernel
// rounds differently.
std::string cpu_instructions() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  const char* vendor = __builtin_cpu_is("intel") ? "intel" : __builtin_cpu_is("amd") ? "amd" : "x86";
  const char* set = "sse";
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) set = "avx2";
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw")) set = "avx512";
  if (__builtin_cpu_supports("avx512vnni")) set = "avx512_vnni";
  if (__builtin_cpu_supports("avx512bf16")) set = "avx512_bf16";
  return fmt::format("{} {}", vendor, set);
#else
  return "no x86";
#endif
}

// Returns the environment variables with which a user limits the instruction sets that the libraries use.
std::string limits_of_the_environment() {
  std::string text;
  for (const char* name : {"ONEDNN_MAX_CPU_ISA", "DNNL_MAX_CPU_ISA", "MKL_ENABLE_INSTRUCTIONS", "MKL_CBWR"}) {
    if (const char* value = std::getenv(name)) text += fmt::format(", {}={}", name, value);
  }
  return text;
}

}  // namespace

std::string arithmetic_of(const DeviceChoice& choice) {
  std::string machine;
  if (choice.device.is_cpu()) {
    machine = fmt::format("{}, kernels {}{}{}", cpu_instructions(), at::get_cpu_capability(),
                          packing_name().empty() ? "" : ", " + packing_name(), limits_of_the_environment());
  } else {
    machine = cuda_device_name(choice.device.has_index() ? choice.device.index() : 0);
  }
  return fmt::format("{}, LibTorch {}", machine, TORCH_VERSION);
}

namespace {

// glibc gives blocks of this size and above back to the system as soon as they are freed.
void set_returned_block_bytes([[maybe_unused]] int bytes) {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, bytes);
#endif
}

constexpr int kLargestKeptBytes = 32 << 20;  // as much as glibc allows
constexpr int kLargestKeptWhileLoadingBytes = 64 << 10;

// Otherwise the system would clear the pages of each batch's large blocks anew.
void keep_freed_memory() {
  set_returned_block_bytes(kLargestKeptBytes);
#ifdef __GLIBC__
  constexpr int kMarginBytes = 64 << 20;
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  mallopt(M_TOP_PAD, kMarginBytes);
#endif
}

}  // namespace

ReturnFreedMemory::ReturnFreedMemory() {
  set_returned_block_bytes(kLargestKeptWhileLoadingBytes);
}

ReturnFreedMemory::~ReturnFreedMemory() {
  set_returned_block_bytes(kLargestKeptBytes);
}

void configure_compute(int threads) {
  if (threads < 1) {
    throw std::invalid_argument(fmt::format("compute threads must be at least 1, got {}", threads));
  }
  at::set_num_threads(threads);
  keep_freed_memory();
  at::Context& context = at::globalContext();
  // Operators without a deterministic form warn instead of failing, and fresh memory is not filled.
  context.setDeterministicAlgorithms(true, /*warn_only=*/true);
  context.setDeterministicFillUninitializedMemory(false);
  context.setSDPUseMemEfficient(false);  // its backward pass adds in any order
  context.setDeterministicCuDNN(true);
  context.setBenchmarkCuDNN(false);
  context.setAllowTF32CuDNN(false);
  context.setFloat32MatmulPrecision("highest");
}

}  // namespace q3d::model
