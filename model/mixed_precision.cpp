#include "model/mixed_precision.h"

#include <ATen/autocast_mode.h>
#include <ATen/cpu/Utils.h>

namespace q3d::model {

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

bool bfloat16_is_fast(torch::Device device) {
  if (!device.is_cpu()) return true;
  const auto capabilities = at::cpu::get_cpu_capabilities();
  const auto found = capabilities.find("avx512_bf16");
  return found != capabilities.end() && found->second.toBool();
}

}  // namespace q3d::model
