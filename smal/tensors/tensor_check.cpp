#include "smal/tensors/tensor_check.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace q3d::smal::tensors {
namespace {

std::string size_text(const std::vector<std::int64_t>& sizes, bool leading_free) {
  std::string text = leading_free ? "(..." : "(";
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (i > 0 || leading_free) text += ", ";
    text += sizes[i] == kAnySize ? "any" : std::to_string(sizes[i]);
  }
  return text + ")";
}

void expect(const torch::Tensor& tensor, const char* where, const char* name,
            const std::vector<std::int64_t>& sizes, bool leading_free) {
  const std::string expected =
      std::string(name) + ", expected " + size_text(sizes, leading_free) + " floating point";
  if (!tensor.defined()) {
    throw std::invalid_argument(std::string(where) + ": undefined tensor for " + expected);
  }
  const std::vector<std::int64_t> got = tensor.sizes().vec();
  const bool rank_fits = leading_free ? got.size() >= sizes.size() : got.size() == sizes.size();
  const bool sizes_fit = rank_fits && std::equal(sizes.rbegin(), sizes.rend(), got.rbegin(),
                                                 [](std::int64_t want, std::int64_t is) {
                                                   return want == kAnySize || want == is;
                                                 });
  if (!sizes_fit || !tensor.is_floating_point()) {
    throw std::invalid_argument(std::string(where) + ": got " + size_text(got, false) + " " +
                                torch::toString(tensor.scalar_type()) + " for " + expected);
  }
}

}  // namespace

void expect_floating(const torch::Tensor& tensor, const char* where, const char* name,
                     const std::vector<std::int64_t>& sizes) {
  expect(tensor, where, name, sizes, false);
}

void expect_trailing(const torch::Tensor& tensor, const char* where, const char* name,
                     const std::vector<std::int64_t>& trailing) {
  expect(tensor, where, name, trailing, true);
}

}  // namespace q3d::smal::tensors
