#include "model/recomputed.h"

#include <ATen/autocast_mode.h>
#include <torch/csrc/autograd/autograd.h>
#include <torch/csrc/autograd/custom_function.h>
#include <torch/custom_class.h>

#include <utility>

#include "model/draws.h"
#include "model/mixed_precision.h"

namespace q3d::model {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::variable_list;

// A call of a part, and what besides its input decides its result.
struct Call : torch::CustomClassHolder {
  Call(NetworkPart called, std::vector<torch::Tensor> uses, torch::Device on)
      : part(std::move(called)),
        parameters(std::move(uses)),
        device(on),
        draws(on),
        is_mixed(at::autocast::is_autocast_enabled(on.type())) {}

  NetworkPart part;
  std::vector<torch::Tensor> parameters;
  torch::Device device;
  Draws draws;    // before the call
  bool is_mixed;  // see MixedPrecision
};

// The parameters are inputs of the function too, so that a search of the graph finds them (c10d's Reducer
// makes one).
struct Recomputed : torch::autograd::Function<Recomputed> {
  static torch::Tensor forward(AutogradContext* context, const torch::Tensor& input, at::TensorList,
                               const c10::intrusive_ptr<Call>& call) {
    context->save_for_backward({input});
    context->saved_data["call"] = c10::IValue::make_capsule(call);
    const at::AutoGradMode with_gradients(true);  // the operators must choose the kernels of a plain call
    return call->part(input.detach().requires_grad_()).detach();
  }

  static variable_list backward(AutogradContext* context, const variable_list& gradients) {
    const auto call = c10::static_intrusive_pointer_cast<Call>(context->saved_data["call"].toCapsule());
    const torch::Tensor input = context->get_saved_variables().at(0).detach().requires_grad_();
    variable_list leaves{input};
    for (const torch::Tensor& parameter : call->parameters) {
      if (parameter.requires_grad()) leaves.push_back(parameter);
    }
    const at::AutoGradMode with_gradients(true);
    torch::Tensor output;
    {
      const RepeatedDraws draws(call->draws);
      const MixedPrecision mixed(call->device, call->is_mixed);
      output = call->part(input);
    }
    const variable_list found = torch::autograd::grad({output}, leaves, gradients, /*retain_graph=*/false,
                                                      /*create_graph=*/false, /*allow_unused=*/true);
    variable_list all{found.front()};
    auto next = found.begin() + 1;
    for (const torch::Tensor& parameter : call->parameters) {
      all.push_back(parameter.requires_grad() ? *next++ : torch::Tensor());
    }
    all.emplace_back();  // of the call
    return all;
  }
};

}  // namespace

torch::Tensor recomputed(const NetworkPart& part, const torch::Tensor& input,
                         const std::vector<torch::Tensor>& parameters) {
  if (!at::GradMode::is_enabled()) return part(input);
  return Recomputed::apply(input, at::TensorList(parameters),
                           c10::make_intrusive<Call>(part, parameters, input.device()));
}

}  // namespace q3d::model
