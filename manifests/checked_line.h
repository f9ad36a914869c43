// Text lines with a checksum, for files that a killed process may leave half written.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace q3d::manifests {

// Returns "payload<TAB>check<LF>", where check is the first 16 hex digits of the payload's SHA-256. Throws
// std::invalid_argument if the payload contains a line feed.
std::string seal_line(std::string_view payload);

// Returns the payload of a line that is given without its line feed, or nothing if the check does not match.
std::optional<std::string_view> open_line(std::string_view line);

}  // namespace q3d::manifests
