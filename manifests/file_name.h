// Checks names that come from a file and become parts of paths. The author of the file must not be able to
// choose a place outside the intended folder.
#pragma once

#include <string_view>

namespace q3d::manifests {

// Returns whether the text can name one file or folder: it is not empty, "." or "..", and has no '/', no
// control character (NUL ends a path for the system), and no '\\' or ':', which separate parts of a path on
// Windows.
bool is_file_name(std::string_view text);

// Returns whether the text is a path from a folder to a file below it: names as above with '/' between them.
// Links in that folder may still lead elsewhere.
bool leads_below(std::string_view path);

}  // namespace q3d::manifests
