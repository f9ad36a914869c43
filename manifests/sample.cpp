#include "manifests/sample.h"

#include "manifests/enum_names.h"
#include "manifests/enumerators.h"

namespace q3d::manifests {
namespace {

// In the order of the enumerators; `none` of Family, which is -1, comes first.
constexpr std::array<std::string_view, 6> kFamilyNames{"none",    "felidae", "canidae",
                                                       "equidae", "bovidae", "hippopotamidae"};
static_assert(kFamilyNames.size() == static_cast<std::size_t>(Family::hippopotamidae) + 2);

constexpr std::array<std::string_view, 38> kReasonNames{
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
};
static_assert(kReasonNames.size() == static_cast<std::size_t>(Reason::trust_too_low) + 1);

}  // namespace

std::string_view to_string(Family family) {
  return kFamilyNames.at(static_cast<std::size_t>(static_cast<int>(family) + 1));
}

Family family_from_string(std::string_view name) {
  return static_cast<Family>(enum_from_name<int>("family", name, kFamilyNames) - 1);
}

std::string_view to_string(Reason reason) {
  return kReasonNames.at(static_cast<std::size_t>(reason));
}

Reason reason_from_string(std::string_view name) {
  return enum_from_name<Reason>("reason", name, kReasonNames);
}

std::span<const std::string_view> reason_names() {
  return kReasonNames;
}

}  // namespace q3d::manifests
