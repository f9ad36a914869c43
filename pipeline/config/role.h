// A dataset's role says where the labels of its samples come from.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "manifests/verdict.h"

namespace q3d::pipeline::config {

// `pseudo`: the network's prediction, judged and refined. `truth`: the body that the annotation file gives.
// `two_d_only`: the annotated keypoints alone. Only `pseudo` needs a network.
enum class Role { pseudo, truth, two_d_only };

std::string_view to_string(Role role);         // pseudo, truth, 2d_only
std::vector<std::string> role_names();         // in the order of the enumerators
Role role_from_string(std::string_view name);  // throws std::invalid_argument on an unknown name

// Returns the kind of label that a kept candidate gets.
manifests::LabelKind label_kind(Role role, manifests::Verdict verdict);

}  // namespace q3d::pipeline::config
