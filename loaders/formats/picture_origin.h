// Tells from a picture's name where it came from before a dataset took it.
#pragma once

#include <string>
#include <string_view>

namespace q3d::loaders::formats {

// Returns "imagenet n02114367_52", "coco 000000015956", "voc 2010_001705", or "". Datasets that took a
// picture from one of these sources kept its name. They added a class or their own number, and may have
// changed its folder, letter case or format.
//
// - `n<8 digits>_<number>`: ImageNet, and Stanford Dogs, which is a part of it.
// - `<12 digits>_<word>`: COCO pictures of Animal3D. Twelve digits alone tell nothing, because AP-10K uses
//   such numbers of its own.
// - `<4 digits>_<6 digits>`: PASCAL VOC, in AnimalPose.
std::string picture_origin(std::string_view file_name);

}  // namespace q3d::loaders::formats
