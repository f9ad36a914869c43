#include "manifests/sample.h"

#include "manifests/enum_names.h"
#include "manifests/enumerators.h"

namespace q3d::manifests {
namespace {

constexpr EnumNames kFamilies("family", Family::none, Family::hippopotamidae,
                              {"none", "felidae", "canidae", "equidae", "bovidae", "hippopotamidae"});
constexpr EnumNames kReasons("reason", Reason::none, Reason::trust_too_low,
                             {
                                 "none",
                                 "box_missing",
                                 "box_not_finite",
                                 "box_zero_size",
                                 "box_outside_image",
                                 "box_too_small",
                                 "keypoints_missing",
                                 "keypoints_wrong_length",
                                 "keypoints_not_finite",
                                 "no_visible_keypoints",
                                 "keypoints_outside",
                                 "not_in_pixels",
                                 "record_malformed",
                                 "image_not_listed",
                                 "pose_missing",
                                 "not_a_quadruped",
                                 "duplicate",
                                 "image_missing",
                                 "image_empty",
                                 "image_is_lfs_pointer",
                                 "image_not_an_image",
                                 "image_truncated",
                                 "image_too_large",
                                 "path_escapes_root",
                                 "size_mismatch",
                                 "prediction_not_finite",
                                 "error_too_large",
                                 "gain_too_small",
                                 "too_few_keypoints",
                                 "scaled_gain_too_small",
                                 "held_out_not_better",
                                 "pose_implausible",
                                 "limbs_implausible",
                                 "left_right_swapped",
                                 "mask_mismatch",
                                 "vetoed",
                                 "in_test_split",
                                 "trust_too_low",
                             });

}  // namespace

std::string_view to_string(Family family) {
  return kFamilies.name(family);
}

Family family_from_string(std::string_view name) {
  return kFamilies.value(name);
}

std::string_view to_string(Reason reason) {
  return kReasons.name(reason);
}

Reason reason_from_string(std::string_view name) {
  return kReasons.value(name);
}

std::span<const std::string_view> reason_names() {
  return kReasons.all();
}

}  // namespace q3d::manifests
