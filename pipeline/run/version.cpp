#include "pipeline/run/version.h"

namespace q3d::pipeline::run {

std::string_view version() {
  return Q3D_VERSION;
}

}  // namespace q3d::pipeline::run
