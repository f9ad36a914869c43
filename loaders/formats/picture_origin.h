// Where a picture came from before a dataset took it, as far as its name tells.
#pragma once

#include <string>
#include <string_view>

namespace q3d::loaders::formats {

// "imagenet n02114367_52", "coco 000000015956", "voc 2010_001705", or "": datasets that took the same picture
// of one of these kept its name, with a class or their own number after it, and in another folder, case or
// format.
//
// - `n<8 digits>_<number>`: ImageNet, and Stanford Dogs, which is a part of it;
// - `<12 digits>_<word>`: COCO pictures of Animal3D. Twelve digits alone are AP-10K's own numbers as often as
//   COCO's, and tell nothing;
// - `<4 digits>_<6 digits>`: PASCAL VOC, in AnimalPose.
std::string picture_origin(std::string_view file_name);

}  // namespace q3d::loaders::formats
