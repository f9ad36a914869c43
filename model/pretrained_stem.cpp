#include "model/pretrained_stem.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <stdexcept>
#include <vector>

#include "model/efficientnet_lite.h"

namespace q3d::model {
namespace {

std::vector<std::string> find_faults(const smal::tensors::SafeTensors& file) {
  const EfficientNetLite plan({torch::kMeta, torch::kFloat32});
  const auto parameters = plan.named_parameters();
  std::vector<std::string> faults;
  for (const auto& parameter : parameters) {
    const at::IntArrayRef expected = parameter.value().sizes();
    if (!file.contains(parameter.key())) {
      faults.push_back(fmt::format("{}: missing, expected [{}]", parameter.key(), fmt::join(expected, ", ")));
      continue;
    }
    const torch::Tensor stored = file.tensor(parameter.key());
    if (stored.sizes() != expected || stored.scalar_type() != torch::kFloat32) {
      faults.push_back(fmt::format("{}: got {} [{}], expected Float [{}]", parameter.key(),
                                   torch::toString(stored.scalar_type()), fmt::join(stored.sizes(), ", "),
                                   fmt::join(expected, ", ")));
    }
  }
  for (const std::string& name : file.names()) {
    if (!parameters.contains(name)) faults.push_back(fmt::format("{}: not part of the stem", name));
  }
  return faults;
}

}  // namespace

PretrainedStem::PretrainedStem(const std::filesystem::path& path)
    : file_(smal::tensors::SafeTensors::open(path)) {
  const std::vector<std::string> faults = find_faults(file_);
  if (faults.empty()) return;
  throw std::runtime_error(fmt::format("{}: not the stem that tools/import_stem.py writes, {} faults:\n  {}",
                                       path.string(), faults.size(), fmt::join(faults, "\n  ")));
}

torch::Tensor PretrainedStem::values(const TensorSpec& parameter) const {
  const std::string name(name_in_efficientnet(parameter.name));
  return name.empty() ? torch::Tensor() : file_.tensor(name).clone();
}

std::map<std::string, std::string> PretrainedStem::origin() const {
  std::map<std::string, std::string> origin;
  for (const auto& [key, value] : file_.metadata()) origin["stem_" + key] = value;
  return origin;
}

}  // namespace q3d::model
