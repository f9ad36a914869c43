// Text lines that carry their own checksum, for files that a killed process may leave half written.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace q3d::manifests {

// "payload<TAB>check<LF>", check = the first 16 hex digits of the payload's SHA-256. The payload must not
// contain a line feed; std::invalid_argument otherwise.
std::string seal_line(std::string_view payload);

// The payload of a line (without its line feed), or nothing when the check does not match.
std::optional<std::string_view> open_line(std::string_view line);

}  // namespace q3d::manifests
