// The sample record, which every loader produces and every stage consumes.
//
// It is a plain value without tensors, images or library types, so that loaders, filters and the pipeline can
// share it without sharing their dependencies.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "smal/body.h"

namespace q3d::manifests {

using smal::kNumBetas;
using smal::kNumJoints;
using smal::kNumKeypoints;  // Animal3D annotates the 26 keypoints of SMAL

// One annotated keypoint, in pixels of the source image, with the origin at the top left. The image is as
// stored, unless the record's `orientation` turns it. `v` is the file's own value, unchanged (-1, 0, 1, 2, or
// a likelihood). `weight` is what the toolkit uses: 0 if the keypoint is not labelled, else 1 or the
// likelihood. A keypoint is visible if its weight is greater than 0.
struct Keypoint {
  double x_px = 0.0;
  double y_px = 0.0;
  float v = 0.0F;
  float weight = 0.0F;
};
using Keypoints = std::array<Keypoint, kNumKeypoints>;

struct Box {  // pixels of the source image, top-left origin, width and height
  double x_px = 0.0;
  double y_px = 0.0;
  double w_px = 0.0;
  double h_px = 0.0;
};

// The five families of the SMAL shape space; `none` for every other animal.
enum class Family : std::int8_t { none = -1, felidae = 0, canidae, equidae, bovidae, hippopotamidae };
std::string_view to_string(Family family);
Family family_from_string(std::string_view name);  // throws std::invalid_argument on an unknown name

// The body that an annotation file gives, in the file's own form. Datasets with 2D keypoints only have none.
struct BodyTruth {
  bool has_pose = false;   // not all 105 numbers are zero
  bool has_betas = false;  // not all 41 numbers are zero
  bool has_keypoints_3d = false;
  smal::AxisAnglePose pose_axis_angle{};
  smal::Betas betas{};
  smal::Translation trans{};
  smal::Keypoints3d keypoints_3d{};
};

// Why a sample failed or was discarded. The names must not change, because they are written into lists and
// shards.
enum class Reason : std::uint8_t {
  none,
  // failed while reading the annotation
  box_missing,
  box_not_finite,
  box_zero_size,
  box_outside_image,
  box_too_small,  // a few pixels
  keypoints_missing,
  keypoints_wrong_length,
  keypoints_not_finite,
  no_visible_keypoints,
  keypoints_outside,  // most labelled keypoints lie outside the picture or outside their box
  not_in_pixels,      // keypoints or box are fractions between 0 and 1
  record_malformed,
  image_not_listed,
  pose_missing,     // the label must come from the file's body, but the record has none
  not_a_quadruped,  // left out by the species rule (birds, primates, ...)
  duplicate,        // an earlier record has the same picture and the same keypoints
  // failed while reading the picture
  image_missing,
  image_empty,
  image_is_lfs_pointer,
  image_not_an_image,
  image_truncated,
  image_too_large,
  path_escapes_root,
  size_mismatch,  // the picture has another size than the annotation file says
  // failed in the network
  prediction_not_finite,
  // discarded by the fidelity rule
  error_too_large,  // L_proj >= tau_high
  gain_too_small,   // relative gain < delta within the first ten iterations
  // discarded by a guard (filters/guards.h)
  too_few_keypoints,      // fewer visible keypoints than visible_min
  scaled_gain_too_small,  // gain < delta within the fewer iterations that few visible keypoints allow
  held_out_not_better,    // adaptation brings the held-out keypoints no closer
  pose_implausible,       // the pose is too far from the prior
  limbs_implausible,      // the length of a limb is too far from those of the families
  left_right_swapped,     // the label fits the annotation better with left and right exchanged
  mask_mismatch,          // the body's silhouette covers too little of the mask, or too much beside it
  // discarded by the user
  vetoed,
  in_test_split,  // its picture, or a copy of it, is in a test split
  // discarded because the config asks for more trust
  trust_too_low,
};
std::string_view to_string(Reason reason);
Reason reason_from_string(std::string_view name);  // throws std::invalid_argument on an unknown name

struct SampleRecord {
  std::string id;       // dataset/split/image#annotation, unique within a build
  std::string dataset;  // name from the config
  std::string split;    // train, test, ...
  std::string source;   // sub-dataset where the file says (SuperAnimal's source_dataset), else empty
  std::string species;  // normalised: lower case, spaces; empty when unknown
  Family family = Family::none;
  std::string image_path;  // absolute, resolved; empty when it could not be resolved
  std::string image_ref;   // as the annotation file names it
  std::string mask_path;   // absolute; empty when there is none
  int width_px = 0;        // as the annotation says, or as its labels were scaled; 0 when it does not
  int height_px = 0;
  int orientation = 1;  // EXIF orientation by which the stored pixels are turned first; 1 does not turn
  double scale = 1.0;   // factor applied to box and keypoints because the picture had been resized
  Box box;
  Keypoints keypoints;
  std::optional<BodyTruth> truth;
  Reason failure = Reason::none;  // set by a loader for a record that cannot be used
  std::string failure_detail;     // got / expected, for people
};

}  // namespace q3d::manifests
