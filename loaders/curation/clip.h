// Tells from the names of pictures which of them are frames of one video.
#pragma once

#include <string>
#include <string_view>

namespace q3d::loaders::curation {

// Returns a picture's name without folder and extension, and without the image id that SuperAnimal appends to
// the names of its sources: "horse_11361_13677.jpg" was horse_11361.
std::string source_stem(std::string_view file_name);

// Returns the folder and the stem of the name without the frame number: "videos/run_0012_345.png", where
// SuperAnimal appended 345, gives "videos/run". If the name is only a number, the result is the folder. If
// names do not distinguish the videos of a source, all of its pictures get the same clip. This is the safe
// side, because the source then stays together.
std::string clip_of_frame(std::string_view file_name);

}  // namespace q3d::loaders::curation
