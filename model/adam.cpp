#include "model/adam.h"

#include <ATen/Parallel.h>
#include <ATen/ops/_fused_adam.h>

#include <algorithm>
#include <cmath>

#include "model/vectorised.h"

namespace q3d::model {
namespace {

constexpr double kBeta1 = 0.9;
constexpr double kBeta2 = 0.999;
constexpr double kEpsilon = 1e-8;

// The factors of a step that depend on the instance's number of steps.
struct Rates {
  float step;           // learning rate / (1 - beta1^n)
  float inverse_root2;  // 1 / sqrt(1 - beta2^n)
};

Rates rates_after(std::int64_t steps, double learning_rate) {
  const auto n = static_cast<double>(steps);
  return {static_cast<float>(learning_rate / (1.0 - std::pow(kBeta1, n))),
          static_cast<float>(1.0 / std::sqrt(1.0 - std::pow(kBeta2, n)))};
}

Q3D_VECTORISED
void step_row(float* __restrict parameter, float* __restrict first, float* __restrict second,
              const float* __restrict gradient, std::int64_t count, Rates rates) {
  constexpr auto kFirst = static_cast<float>(kBeta1);
  constexpr auto kSecond = static_cast<float>(kBeta2);
  constexpr auto kFirstRest = static_cast<float>(1.0 - kBeta1);
  constexpr auto kSecondRest = static_cast<float>(1.0 - kBeta2);
  constexpr auto kTiny = static_cast<float>(kEpsilon);
  for (std::int64_t i = 0; i < count; ++i) {
    const float g = gradient[i];
    first[i] = kFirst * first[i] + kFirstRest * g;
    second[i] = kSecond * second[i] + kSecondRest * g * g;
    parameter[i] -= rates.step * first[i] / (std::sqrt(second[i]) * rates.inverse_root2 + kTiny);
  }
}

Q3D_VECTORISED
void add_scaled(float* __restrict sum, const float* __restrict row, float scale, std::int64_t count) {
  for (std::int64_t i = 0; i < count; ++i) sum[i] += scale * row[i];
}

// Computes a row's gradient, which is the sum of scaled inputs over the outer products.
void outer_row(const InstanceGradient& gradient, std::int64_t instance, std::int64_t out,
               std::vector<float>& row) {
  std::fill(row.begin(), row.end(), 0.0F);
  for (const auto& [left, right] : gradient.outer_products) {
    const auto width = static_cast<std::int64_t>(row.size());
    const float scale = left.const_data_ptr<float>()[instance * left.size(1) + out];
    add_scaled(row.data(), right.const_data_ptr<float>() + instance * width, scale, width);
  }
}

InstanceGradient contiguous(const InstanceGradient& gradient) {
  InstanceGradient result;
  if (gradient.dense.defined()) result.dense = gradient.dense.contiguous();
  for (const auto& [left, right] : gradient.outer_products) {
    result.outer_products.emplace_back(left.contiguous(), right.contiguous());
  }
  return result;
}

void step_in_place(const AdamState& state, const InstanceGradient& given, const std::vector<Rates>& rates) {
  constexpr std::int64_t kRowsATask = 64;
  const InstanceGradient gradient = contiguous(given);
  const bool is_dense = gradient.dense.defined();
  const std::int64_t rows = is_dense ? 1 : state.parameter.size(1);
  const std::int64_t width = state.parameter[0].numel() / rows;
  auto* parameter = state.parameter.data_ptr<float>();
  auto* first = state.first_moment.data_ptr<float>();
  auto* second = state.second_moment.data_ptr<float>();
  const auto all = static_cast<std::int64_t>(rates.size()) * rows;
  at::parallel_for(0, all, kRowsATask, [&](std::int64_t begin, std::int64_t end) {
    std::vector<float> written(is_dense ? 0 : static_cast<std::size_t>(width));
    for (std::int64_t row = begin; row < end; ++row) {
      if (!is_dense) outer_row(gradient, row / rows, row % rows, written);
      const float* numbers = is_dense ? gradient.dense.const_data_ptr<float>() + row * width : written.data();
      const std::int64_t at = row * width;
      step_row(parameter + at, first + at, second + at, numbers, width,
               rates[static_cast<std::size_t>(row / rows)]);
    }
  });
}

torch::Tensor written_out(const InstanceGradient& gradient) {
  if (gradient.dense.defined()) return gradient.dense;
  torch::Tensor sum;
  for (const auto& [left, right] : gradient.outer_products) {
    const torch::Tensor product = left.unsqueeze(2) * right.unsqueeze(1);
    sum = sum.defined() ? sum + product : product;
  }
  return sum;
}

// Steps with LibTorch's kernel. It takes a number of steps for each tensor, so each instance's rows are
// passed as a separate tensor.
void step_by_libtorch(const std::vector<AdamState>& states, const std::vector<InstanceGradient>& gradients,
                      const std::vector<std::int64_t>& steps, double learning_rate) {
  std::vector<torch::Tensor> parameters, numbers, first, second, counts;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const torch::Tensor gradient = written_out(gradients[i]);
    for (std::size_t slot = 0; slot < steps.size(); ++slot) {
      const auto row = static_cast<std::int64_t>(slot);
      parameters.push_back(states[i].parameter[row]);
      numbers.push_back(gradient[row].contiguous());
      first.push_back(states[i].first_moment[row]);
      second.push_back(states[i].second_moment[row]);
      counts.push_back(torch::full({}, static_cast<double>(steps[slot]),
                                   parameters.back().options().dtype(torch::kFloat32)));
    }
  }
  at::_fused_adam_(parameters, numbers, first, second, {}, counts, learning_rate, kBeta1, kBeta2,
                   /*weight_decay=*/0.0, kEpsilon, /*amsgrad=*/false, /*maximize=*/false);
}

}  // namespace

void adam_step(const std::vector<AdamState>& states, const std::vector<InstanceGradient>& gradients,
               const std::vector<std::int64_t>& steps, double learning_rate) {
  TORCH_CHECK(states.size() == gradients.size(), "adam_step: ", states.size(), " parameters and ",
              gradients.size(), " gradients");
  if (states.empty() || steps.empty()) return;
  const at::NoGradGuard no_grad;
  const torch::Tensor& any = states.front().parameter;
  if (!any.is_cpu() || any.scalar_type() != torch::kFloat32) {
    step_by_libtorch(states, gradients, steps, learning_rate);
    return;
  }
  std::vector<Rates> rates;
  for (const std::int64_t count : steps) rates.push_back(rates_after(count, learning_rate));
  for (std::size_t i = 0; i < states.size(); ++i) step_in_place(states[i], gradients[i], rates);
}

}  // namespace q3d::model
