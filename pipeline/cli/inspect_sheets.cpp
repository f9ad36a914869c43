#include "pipeline/cli/inspect_command.h"
#include "pipeline/network/torch_bodies.h"

namespace q3d::pipeline::cli {

Command add_inspect_with_sheets(CLI::App& app) {
  return add_inspect_with(app, network::load_body_meshes);
}

}  // namespace q3d::pipeline::cli
