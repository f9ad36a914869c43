// The SMAL asset: everything that defines a body model, in one safetensors file.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "smal/sizes.h"

namespace q3d::smal::tensors {

struct SmalAsset {
  // Model units are about metres; x to the head, y up, z to the right.
  torch::Tensor v_template;   // (V, 3) float32
  torch::Tensor faces;        // (F, 3) int32, counter-clockwise seen from outside
  torch::Tensor shapedirs;    // (V, 3, 41) float32
  torch::Tensor posedirs;     // (306, 3 V) float32: row 9 (joint - 1) + 3 r + c, column 3 vertex + xyz
  torch::Tensor j_regressor;  // (35, V) float32, rows sum to 1
  torch::Tensor lbs_weights;  // (V, 35) float32, rows sum to 1
  torch::Tensor parents;      // (35) int32, parents[0] = -1, parents[j] < j
  std::vector<std::vector<std::int64_t>> keypoint_vertices;  // 26 groups of vertex indices
  std::string name;
  std::string licence;
};

// Checks shapes, dtypes, the kinematic tree (a root, no cycle, parents before children), that the rows of
// weights and regressor sum to 1, that indices are in range, and that all numbers are finite. Throws
// std::runtime_error that names the tensor, what was found and what was expected.
void check_asset(const SmalAsset& asset, const std::string& where);

// Reads an asset and checks it (check_asset). Throws std::runtime_error.
SmalAsset load_asset(const std::filesystem::path& path);
void save_asset(const std::filesystem::path& path, const SmalAsset& asset);

}  // namespace q3d::smal::tensors
