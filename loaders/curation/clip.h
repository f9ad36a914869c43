// Which pictures are frames of one video, as far as their names tell.
#pragma once

#include <string>
#include <string_view>

namespace q3d::loaders::curation {

// A picture's name without folder and extension, and without the image id that SuperAnimal appends to the
// names of its sources: "horse_11361_13677.jpg" was horse_11361.
std::string source_stem(std::string_view file_name);

// The name's folder and stem without the frame's number: "videos/run_0012_345.png", where 345 is
// SuperAnimal's, is of "videos/run". Where a name is nothing but a number, the folder. A source whose names
// do not tell its videos apart is then one clip, which errs on the safe side: it stays whole.
std::string clip_of_frame(std::string_view file_name);

}  // namespace q3d::loaders::curation
