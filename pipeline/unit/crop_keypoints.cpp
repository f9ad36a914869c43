#include "pipeline/unit/crop_keypoints.h"

#include "loaders/pictures/crop.h"

namespace q3d::pipeline::unit {

device::CropKeypoints crop_keypoints(const manifests::SampleRecord& record) {
  const loaders::pictures::SquareBox box = loaders::pictures::square_box(record.box);
  return loaders::pictures::keypoints_to_crop(
      record.keypoints, loaders::pictures::patch_from_image(box, loaders::pictures::kPatchSidePx));
}

int visible_keypoints(const device::CropKeypoints& keypoints) {
  int visible = 0;
  for (std::size_t k = 0; k < manifests::kNumKeypoints; ++k) visible += keypoints[3 * k + 2] > 0.0F ? 1 : 0;
  return visible;
}

}  // namespace q3d::pipeline::unit
