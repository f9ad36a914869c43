#include "model/mixed_precision.h"

#include <ATen/Version.h>
#include <ATen/autocast_mode.h>

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

bool bfloat16_is_slow(torch::Device device) {
  const std::string vectors = at::get_cpu_capability();
  return device.is_cpu() && (vectors == "AVX2" || vectors == "DEFAULT");
}

}  // namespace q3d::model
