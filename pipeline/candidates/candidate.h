// A candidate: an annotated picture that may become a sample of the dataset.
#pragma once

#include <string>

#include "manifests/sample.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::candidates {

// The reason why a candidate is left out, independent of its prediction.
struct Exclusion {
  manifests::Reason reason = manifests::Reason::none;
  std::string detail;  // for people
};

struct Candidate {
  manifests::SampleRecord record;
  std::string image_sha256;                  // empty if the picture does not exist
  std::string mask_sha256;                   // empty if there is no mask, or its file does not exist
  config::Role role = config::Role::pseudo;  // the role of its dataset
  std::string finding;                       // result of the check of its body, for people; may be empty
  Exclusion exclusion{};
};

}  // namespace q3d::pipeline::candidates
