#include "smal/tensors/asset.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "smal/tensors/safetensors.h"

namespace q3d::smal::tensors {
namespace {

constexpr const char* kFormat = "quadruped3d-smal-1";

std::string shape_text(const std::vector<std::int64_t>& sizes) {
  std::string text = "(";
  for (std::size_t i = 0; i < sizes.size(); ++i) text += (i > 0 ? ", " : "") + std::to_string(sizes[i]);
  return text + ")";
}

// Checks the parts of an asset. Every message names the asset.
class AssetChecker {
 public:
  AssetChecker(const SmalAsset& asset, const std::string& where) : asset_(asset), where_(where) {}

  void check() const {
    check_tensors();
    check_tree();
    check_rows_sum_to_one("lbs_weights", asset_.lbs_weights);
    check_rows_sum_to_one("j_regressor", asset_.j_regressor);
    check_faces();
    check_keypoint_groups();
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(where_ + ": not a usable SMAL asset: " + what);
  }

  void check_tensors() const {
    const torch::Tensor& v = asset_.v_template;
    if (!v.defined() || v.dim() != 2 || v.size(0) < 1) fail("v_template is not a (V, 3) tensor with V > 0");
    const std::int64_t vertices = v.size(0);
    const std::int64_t faces = asset_.faces.defined() && asset_.faces.dim() > 0 ? asset_.faces.size(0) : 0;
    check_tensor("v_template", v, torch::kFloat32, {vertices, 3});
    check_tensor("faces", asset_.faces, torch::kInt32, {faces, 3});
    check_tensor("shapedirs", asset_.shapedirs, torch::kFloat32, {vertices, 3, kNumBetas});
    check_tensor("posedirs", asset_.posedirs, torch::kFloat32, {9 * (kNumJoints - 1), 3 * vertices});
    check_tensor("j_regressor", asset_.j_regressor, torch::kFloat32, {kNumJoints, vertices});
    check_tensor("lbs_weights", asset_.lbs_weights, torch::kFloat32, {vertices, kNumJoints});
    check_tensor("parents", asset_.parents, torch::kInt32, {kNumJoints});
  }

  void check_tensor(const char* name, const torch::Tensor& tensor, torch::ScalarType dtype,
                    const std::vector<std::int64_t>& sizes) const {
    if (!tensor.defined()) fail(fmt::format("{} is missing", name));
    if (tensor.scalar_type() != dtype || tensor.sizes() != torch::IntArrayRef(sizes)) {
      fail(fmt::format("{} is {} {}, expected {} {}", name, torch::toString(tensor.scalar_type()),
                       shape_text(tensor.sizes().vec()), torch::toString(dtype), shape_text(sizes)));
    }
    if (tensor.is_floating_point() && !tensor.isfinite().all().item<bool>()) {
      fail(fmt::format("{} holds a number that is not finite", name));
    }
  }

  void check_tree() const {
    const torch::Tensor table = asset_.parents.cpu().contiguous();
    const auto* parents = table.data_ptr<std::int32_t>();
    if (parents[0] != -1) fail(fmt::format("parents[0] is {}, expected -1 (the root)", parents[0]));
    for (std::int64_t joint = 1; joint < kNumJoints; ++joint) {
      if (parents[joint] < 0 || parents[joint] >= kNumJoints) {
        fail(fmt::format("parents[{}] is {}, expected a joint from 0 to {}", joint, parents[joint],
                         kNumJoints - 1));
      }
    }
    for (std::int64_t joint = 1; joint < kNumJoints; ++joint) {
      std::int64_t above = joint;
      for (std::int64_t step = 0; step < kNumJoints && above != 0; ++step) above = parents[above];
      if (above != 0) fail(fmt::format("the kinematic tree has a cycle above joint {}", joint));
    }
    for (std::int64_t joint = 1; joint < kNumJoints; ++joint) {
      if (parents[joint] >= joint) {
        fail(
            fmt::format("parents[{}] is {}, but a parent must come before its child", joint, parents[joint]));
      }
    }
  }

  void check_rows_sum_to_one(const char* name, const torch::Tensor& rows) const {
    constexpr double kTolerance = 1e-3;  // the official tables are rounded from double
    const torch::Tensor sums = rows.to(torch::kFloat64).sum(1);
    const std::int64_t worst = (sums - 1.0).abs().argmax().item<std::int64_t>();
    const double sum = sums[worst].item<double>();
    if (std::abs(sum - 1.0) > kTolerance)
      fail(fmt::format("row {} of {} sums to {}, expected 1", worst, name, sum));
  }

  void check_faces() const {
    if (asset_.faces.size(0) == 0) fail("faces is empty");
    const std::int64_t vertices = asset_.v_template.size(0);
    const std::int64_t lowest = asset_.faces.min().item<std::int64_t>();
    const std::int64_t highest = asset_.faces.max().item<std::int64_t>();
    if (lowest < 0 || highest >= vertices) {
      fail(
          fmt::format("faces holds index {}, expected 0 to {}", lowest < 0 ? lowest : highest, vertices - 1));
    }
  }

  void check_keypoint_groups() const {
    const auto groups = static_cast<std::int64_t>(asset_.keypoint_vertices.size());
    if (groups != kNumKeypoints) fail(fmt::format("{} keypoint groups, expected {}", groups, kNumKeypoints));
    const std::int64_t vertices = asset_.v_template.size(0);
    for (std::size_t k = 0; k < asset_.keypoint_vertices.size(); ++k) {
      if (asset_.keypoint_vertices[k].empty()) fail(fmt::format("keypoint {} has no vertices", k));
      for (const std::int64_t vertex : asset_.keypoint_vertices[k]) {
        if (vertex < 0 || vertex >= vertices) {
          fail(fmt::format("keypoint {} has vertex {}, expected 0 to {}", k, vertex, vertices - 1));
        }
      }
    }
  }

  const SmalAsset& asset_;
  const std::string& where_;
};

// Returns the 26 groups as one list and 27 offsets into it, which is the form in the file.
std::pair<torch::Tensor, torch::Tensor> flatten(const std::vector<std::vector<std::int64_t>>& groups) {
  std::vector<std::int64_t> flat;
  std::vector<std::int64_t> offsets = {0};
  for (const auto& group : groups) {
    flat.insert(flat.end(), group.begin(), group.end());
    offsets.push_back(static_cast<std::int64_t>(flat.size()));
  }
  return {torch::tensor(flat, torch::kInt32), torch::tensor(offsets, torch::kInt32)};
}

std::vector<std::vector<std::int64_t>> unflatten(const torch::Tensor& flat, const torch::Tensor& offsets,
                                                 const std::string& where) {
  if (flat.scalar_type() != torch::kInt32 || offsets.scalar_type() != torch::kInt32 || flat.dim() != 1 ||
      offsets.dim() != 1 || offsets.size(0) != kNumKeypoints + 1) {
    throw std::runtime_error(fmt::format(
        "{}: keypoint_vertices and keypoint_offsets are {} and {}, expected two "
        "int32 lists, the second of {}",
        where, shape_text(flat.sizes().vec()), shape_text(offsets.sizes().vec()), kNumKeypoints + 1));
  }
  const auto* vertex = flat.data_ptr<std::int32_t>();
  const auto* offset = offsets.data_ptr<std::int32_t>();
  std::vector<std::vector<std::int64_t>> groups;
  for (std::int64_t k = 0; k < kNumKeypoints; ++k) {
    if (offset[k] < 0 || offset[k] > offset[k + 1] || offset[k + 1] > flat.size(0)) {
      throw std::runtime_error(fmt::format("{}: keypoint_offsets {} and {} are [{}, {}) of {} vertices",
                                           where, k, k + 1, offset[k], offset[k + 1], flat.size(0)));
    }
    groups.emplace_back(vertex + offset[k], vertex + offset[k + 1]);
  }
  return groups;
}

}  // namespace

void check_asset(const SmalAsset& asset, const std::string& where) {
  AssetChecker(asset, where).check();
}

SmalAsset load_asset(const std::filesystem::path& path) {
  const SafeTensors file = SafeTensors::open(path);
  const auto& metadata = file.metadata();
  const auto text = [&metadata](const char* key) {
    const auto found = metadata.find(key);
    return found == metadata.end() ? std::string() : found->second;
  };
  if (text("format") != kFormat) {
    throw std::runtime_error(fmt::format(
        "{}: not a SMAL asset: its metadata has format '{}', expected '{}'; make one with `make assets`",
        path.string(), text("format").substr(0, 40), kFormat));
  }
  SmalAsset asset;
  asset.v_template = file.tensor("v_template");
  asset.faces = file.tensor("faces");
  asset.shapedirs = file.tensor("shapedirs");
  asset.posedirs = file.tensor("posedirs");
  asset.j_regressor = file.tensor("J_regressor");
  asset.lbs_weights = file.tensor("lbs_weights");
  asset.parents = file.tensor("parents");
  asset.keypoint_vertices =
      unflatten(file.tensor("keypoint_vertices"), file.tensor("keypoint_offsets"), path.string());
  asset.name = text("name");
  asset.licence = text("licence");
  check_asset(asset, path.string());
  return asset;
}

void save_asset(const std::filesystem::path& path, const SmalAsset& asset) {
  check_asset(asset, path.string());
  const auto [flat, offsets] = flatten(asset.keypoint_vertices);
  write_safetensors(path,
                    {{"v_template", asset.v_template},
                     {"faces", asset.faces},
                     {"shapedirs", asset.shapedirs},
                     {"posedirs", asset.posedirs},
                     {"J_regressor", asset.j_regressor},
                     {"lbs_weights", asset.lbs_weights},
                     {"parents", asset.parents},
                     {"keypoint_vertices", flat},
                     {"keypoint_offsets", offsets}},
                    {{"format", kFormat}, {"name", asset.name}, {"licence", asset.licence}});
}

}  // namespace q3d::smal::tensors
