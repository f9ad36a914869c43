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
    throw std::runtime_error(fmt::format(
        "{}\nThe guards pose_deviation_max and limb_factor_max, and the terms "
        "tta.pose_prior_weight and tta.shape_prior_weight (the profile strict has the first), need "
        "the pose and shape priors: give their file as guards.priors",
        error.what()));
  }
}

}  // namespace

unit::MeasuringModels load_measuring_models(const config::BuildConfig& config) {
  unit::MeasuringModels models;
  models.meshes = network::load_body_meshes(config.network.smal_asset);
  network::use_compute_threads(network::compute_threads(config.network));
  const bool are_given = !config.guards.priors.empty();
  if (are_given || config::uses_priors(config.guards) || config::uses_priors(config.tta) ||
      network::has_priors(config.network.checkpoint)) {
    models.priors = load_priors(config::priors_file(config));
  }
  return models;
}

}  // namespace q3d::pipeline::build
