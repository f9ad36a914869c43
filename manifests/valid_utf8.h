// Names of files may hold any bytes, and JSON holds UTF-8 alone.
#pragma once

#include <string>
#include <string_view>

namespace q3d::manifests {

bool is_utf8(std::string_view text);

// Returns the text with every byte that is no part of a UTF-8 character written out: "caf\xe9" in Latin-1
// becomes the seven characters caf\xe9. Valid text comes back as it is.
std::string valid_utf8(std::string_view text);

}  // namespace q3d::manifests
