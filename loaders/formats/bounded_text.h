// Bounds texts of annotation files that go into ids, tables and notes.
#pragma once

#include <cstddef>
#include <string>

namespace q3d::loaders::formats {

// A path on Linux may be as long as this.
inline constexpr std::size_t kMaxTextBytes = 4096;

// Returns the text; one of more than kMaxTextBytes is shortened to its first 200 bytes, "~" and 12 digits of
// its SHA-256, so that different texts stay different. A column of a table is as wide as its longest text, so
// one endless name would need that much memory for every sample.
std::string bounded_text(std::string text);

}  // namespace q3d::loaders::formats
