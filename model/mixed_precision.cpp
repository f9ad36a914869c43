#include "model/mixed_precision.h"

#include <ATen/autocast_mode.h>
#include <ATen/cpu/Utils.h>

namespace q3d::model {
namespace {

bool processor_has(const char* capability) {
  const auto capabilities = at::cpu::get_cpu_capabilities();
  const auto found = capabilities.find(capability);
  return found != capabilities.end() && found->second.toBool();
}

bool is_amd() {
#if defined(__x86_64__)
  return __builtin_cpu_is("amd") != 0;
#else
  return false;
#endif
}

}  // namespace

MixedPrecision::MixedPrecision(torch::Device device, bool enabled)
    : kind_(device.type()),
      was_enabled_(at::autocast::is_autocast_enabled(kind_)),
      previous_dtype_(at::autocast::get_autocast_dtype(kind_)) {
  at::autocast::increment_nesting();
  at::autocast::set_autocast_enabled(kind_, enabled);
  at::autocast::set_autocast_dtype(kind_, torch::kBFloat16);
}

MixedPrecision::~MixedPrecision() {
  if (at::autocast::decrement_nesting() == 0) at::autocast::clear_cache();
  at::autocast::set_autocast_enabled(kind_, was_enabled_);
  at::autocast::set_autocast_dtype(kind_, previous_dtype_);
}

bool multiplies_in_bfloat16(torch::Device device) {
  return !device.is_cpu() || processor_has("avx512_bf16");
}

bool bfloat16_is_fast(torch::Device device) {
  if (!multiplies_in_bfloat16(device)) return false;
  return !device.is_cpu() || is_amd() || processor_has("amx_bf16");
}

}  // namespace q3d::model
