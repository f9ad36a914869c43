// A candidate: an annotated picture that may become a sample of the dataset.
#pragma once

#include <string>

#include "manifests/sample.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::candidates {

// The reason why a candidate is left out, whatever its prediction.
struct Exclusion {
  manifests::Reason reason = manifests::Reason::none;
  std::string detail;  // for people
};

struct Candidate {
  manifests::SampleRecord record;
  std::string image_sha256;                  // empty when the picture is not there
  std::string mask_sha256;                   // empty when there is none, or its file is not there
  config::Role role = config::Role::pseudo;  // its dataset's
  std::string finding;  // of the check of its body, for people; empty where there is nothing to tell
  Exclusion exclusion{};
};

}  // namespace q3d::pipeline::candidates
