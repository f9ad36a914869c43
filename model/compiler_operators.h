// Finds operators of LibTorch's own compiler in its table of operators, because LibTorch has no C++ functions
// for them.
#pragma once

#include <ATen/core/dispatch/Dispatcher.h>

namespace q3d::model {

// Throws c10::Error when this LibTorch has no such operator.
template <typename Signature>
c10::TypedOperatorHandle<Signature> find_operator(const char* name) {
  return c10::Dispatcher::singleton().findSchemaOrThrow(name, "").typed<Signature>();
}

}  // namespace q3d::model
