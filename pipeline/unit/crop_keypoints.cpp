#include "pipeline/unit/crop_keypoints.h"

#include <algorithm>

#include "loaders/pictures/crop.h"

namespace q3d::pipeline::unit {

device::CropKeypoints crop_keypoints(const manifests::SampleRecord& record) {
  const loaders::pictures::SquareBox box = loaders::pictures::square_box(record.box);
  return loaders::pictures::keypoints_to_crop(
      record.keypoints, loaders::pictures::patch_from_image(box, loaders::pictures::kPatchSidePx));
}

int visible_keypoints(const device::CropKeypoints& keypoints) {
  return static_cast<int>(std::count_if(keypoints.begin(), keypoints.end(),
                                        [](const smal::CropKeypoint& k) { return k.is_visible(); }));
}

}  // namespace q3d::pipeline::unit
