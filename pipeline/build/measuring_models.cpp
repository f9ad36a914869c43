#include "pipeline/build/measuring_models.h"

#include <fmt/format.h>

#include <stdexcept>

#include "pipeline/network/torch_bodies.h"
#include "pipeline/network/torch_network.h"

namespace q3d::pipeline::build {
namespace {

device::PriorNumbers load_priors(const std::filesystem::path& file) {
  try {
    return network::read_priors(file);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(
        fmt::format("{}\nThe guards pose_deviation_max and limb_factor_max need the pose and shape priors: "
                    "give their file as guards.priors",
                    error.what()));
  }
}

}  // namespace

unit::MeasuringModels load_measuring_models(const config::BuildConfig& config) {
  unit::MeasuringModels models;
  if (unit::needs_meshes(config.guards)) {
    models.meshes = network::load_body_meshes(config.network.smal_asset);
    network::use_compute_threads(network::compute_threads(config.network));
  }
  if (config::uses_priors(config.guards)) models.priors = load_priors(config::priors_file(config));
  return models;
}

}  // namespace q3d::pipeline::build
