// Recognises names that people would call the same.
#pragma once

#include <string>
#include <string_view>

namespace q3d::loaders::formats {

// Returns the same text for names that differ only in letter case, in how Unicode writes an accent (NFC, as
// Linux and Windows have it, or NFD, as macOS has it), in '+' for a space, or in .jpeg or .jpe for .jpg. A
// name that is not valid UTF-8 keeps its accents.
std::string folded_name(std::string_view name);

}  // namespace q3d::loaders::formats
