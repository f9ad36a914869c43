// Reads the file of a pre-trained stem, which holds the parameters of an EfficientNetLite, with origin and
// licence in the metadata. tools/import_stem.py writes it.
#pragma once

#include <torch/types.h>

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "model/checkpoint.h"
#include "smal/tensors/safetensors.h"

namespace q3d::model {

class PretrainedStem {
 public:
  // Throws std::runtime_error that names the file and every parameter that is missing, extra, of another
  // shape or not of float32.
  explicit PretrainedStem(const std::filesystem::path& path);

  // The file's values for a parameter of a network; undefined for one that belongs to no EfficientNet.
  torch::Tensor values(const TensorSpec& parameter) const;

  // The file's metadata, each key with the prefix "stem_": for the checkpoint of a network that starts from
  // it.
  std::map<std::string, std::string> origin() const;

 private:
  smal::tensors::SafeTensors file_;
};

}  // namespace q3d::model
