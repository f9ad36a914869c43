#include "tests/support/parity_smal.h"

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "smal/tensors/safetensors.h"

namespace q3d::testing {
namespace {

nlohmann::json read_meta(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path.string() + ": cannot open");
  return nlohmann::json::parse(file).at("meta");
}

std::vector<std::vector<std::int64_t>> split_groups(const torch::Tensor& flat, const torch::Tensor& offsets) {
  const auto vertex = flat.accessor<std::int32_t, 1>();
  const auto offset = offsets.accessor<std::int32_t, 1>();
  std::vector<std::vector<std::int64_t>> groups;
  for (std::int64_t k = 0; k + 1 < offsets.size(0); ++k) {
    auto& group = groups.emplace_back();
    for (std::int64_t i = offset[k]; i < offset[k + 1]; ++i) group.push_back(vertex[i]);
  }
  return groups;
}

}  // namespace

smal::tensors::SmalAsset load_parity_asset(const std::filesystem::path& folder) {
  const auto file = smal::tensors::SafeTensors::open(folder / "smal_asset.safetensors");
  const nlohmann::json meta = read_meta(folder / "smal_asset.json");
  const auto scaled = [&](const char* tensor, const char* scale) {
    return file.tensor(tensor).to(torch::kFloat32) * meta.at(scale).get<float>();
  };
  const auto index = [&file](const char* tensor) { return file.tensor(tensor).to(torch::kInt64); };

  smal::tensors::SmalAsset asset;
  asset.name = "golden numbers";
  asset.v_template = file.tensor("v_template");
  asset.faces = file.tensor("faces").to(torch::kInt32);
  asset.shapedirs = scaled("shapedirs_i8", "shapedirs_scale");
  asset.posedirs = scaled("posedirs_i8", "posedirs_scale");
  asset.parents = file.tensor("parents");

  const std::int64_t vertices = asset.v_template.size(0);
  asset.j_regressor = torch::zeros({smal::kNumJoints, vertices});
  asset.j_regressor.index_put_({index("J_regressor_row"), index("J_regressor_col")},
                               file.tensor("J_regressor_val"),
                               /*accumulate=*/true);
  // Padding repeats joint 0 with weight 0, so the entries are added.
  asset.lbs_weights = torch::zeros({vertices, smal::kNumJoints});
  asset.lbs_weights.scatter_add_(1, index("lbs_weights_idx"), file.tensor("lbs_weights_val"));
  asset.keypoint_vertices =
      split_groups(file.tensor("keypoint_vertices_flat"), file.tensor("keypoint_vertices_offsets"));
  return asset;
}

}  // namespace q3d::testing
