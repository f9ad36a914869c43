#include "manifests/shard_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string_view>

#include "manifests/trust.h"

namespace q3d::manifests {
namespace {

using Shape = std::vector<std::int64_t>;

// Makes a column of numbers. `access(sample)` returns a reference to the value whose bytes are the row.
template <typename T, typename Access>
ShardColumn numbers(std::string name, Shape shape, std::string units, std::string meaning, Access access) {
  const std::size_t bytes = static_cast<std::size_t>(elements_per_row(shape)) * sizeof(T);
  NumberColumn column{element_type<T>::value, std::move(shape), {}, {}};
  column.store = [access, bytes](const ShardSample& sample, std::byte* row) {
    static_assert(sizeof(access(sample)) % sizeof(T) == 0);
    std::memcpy(row, &access(sample), bytes);
  };
  column.load = [access, bytes](ShardSample& sample, const std::byte* row) {
    std::memcpy(&access(sample), row, bytes);
  };
  return {std::move(name), std::move(units), std::move(meaning), std::move(column)};
}

template <typename T, std::size_t N>
ShardColumn keypoint_numbers(std::string name, Shape shape, std::string units, std::string meaning,
                             std::array<T Keypoint::*, N> members) {
  NumberColumn column{element_type<T>::value, std::move(shape), {}, {}};
  column.store = [members](const ShardSample& sample, std::byte* row) {
    for (const Keypoint& keypoint : sample.record.keypoints) {
      for (const auto member : members) {
        std::memcpy(row, &(keypoint.*member), sizeof(T));
        row += sizeof(T);
      }
    }
  };
  column.load = [members](ShardSample& sample, const std::byte* row) {
    for (Keypoint& keypoint : sample.record.keypoints) {
      for (const auto member : members) {
        std::memcpy(&(keypoint.*member), row, sizeof(T));
        row += sizeof(T);
      }
    }
  };
  return {std::move(name), std::move(units), std::move(meaning), std::move(column)};
}

// A flag, stored as 0 or 1.
template <typename Get, typename Set>
ShardColumn flag(std::string name, std::string meaning, Get get, Set set) {
  NumberColumn column{ElementType::uint8, {}, {}, {}};
  column.store = [get](const ShardSample& sample, std::byte* row) { *row = std::byte{get(sample)}; };
  column.load = [set](ShardSample& sample, const std::byte* row) {
    if (std::to_integer<int>(*row) > 1) {
      throw std::runtime_error(fmt::format("got {}, expected 0 or 1", std::to_integer<int>(*row)));
    }
    set(sample, *row == std::byte{1});
  };
  return {std::move(name), "", std::move(meaning), std::move(column)};
}

ShardColumn flag(std::string name, std::string meaning, bool ShardSample::*member) {
  return flag(
      std::move(name), std::move(meaning), [member](const ShardSample& sample) { return sample.*member; },
      [member](ShardSample& sample, bool value) { sample.*member = value; });
}

// A flag of the annotation's body. Without a body it is 0, and reading skips it.
ShardColumn truth_flag(std::string name, std::string meaning, bool BodyTruth::*member) {
  return flag(
      std::move(name), std::move(meaning),
      [member](const ShardSample& sample) { return sample.record.truth && (*sample.record.truth).*member; },
      [member](ShardSample& sample, bool value) {
        if (sample.record.truth) (*sample.record.truth).*member = value;
      });
}

template <std::size_t N>
ShardColumn truth_numbers(std::string name, Shape shape, std::string units, std::string meaning,
                          std::array<float, N> BodyTruth::*member) {
  NumberColumn column{ElementType::float32, std::move(shape), {}, {}};
  column.store = [member](const ShardSample& sample, std::byte* row) {
    const std::array<float, N> values =
        sample.record.truth ? (*sample.record.truth).*member : std::array<float, N>{};
    std::memcpy(row, values.data(), sizeof(values));
  };
  column.load = [member](ShardSample& sample, const std::byte* row) {
    if (sample.record.truth) std::memcpy(((*sample.record.truth).*member).data(), row, N * sizeof(float));
  };
  return {std::move(name), std::move(units), std::move(meaning), std::move(column)};
}

template <typename Access>
ShardColumn text(std::string name, std::string meaning, Access access) {
  return {
      std::move(name), "", std::move(meaning),
      TextColumn{[access](const ShardSample& sample) { return access(sample); },
                 [access](ShardSample& sample, std::string value) { access(sample) = std::move(value); }}};
}

// An enumeration, stored by its stable names.
template <typename Access, typename Enum>
ShardColumn names(std::string name, std::string meaning, Access access,
                  Enum (*from_string)(std::string_view)) {
  return {std::move(name), "", std::move(meaning),
          TextColumn{[access](const ShardSample& sample) { return std::string(to_string(access(sample))); },
                     [access, from_string](ShardSample& sample, std::string value) {
                       access(sample) = from_string(value);
                     }}};
}

ShardColumn bytes(std::string name, std::string meaning, std::vector<std::byte> ShardSample::*member) {
  return {std::move(name), "", std::move(meaning), BytesColumn{member}};
}

ShardColumn family() {
  NumberColumn column{ElementType::int8, {}, {}, {}};
  column.store = [](const ShardSample& sample, std::byte* row) {
    *row = static_cast<std::byte>(static_cast<std::int8_t>(sample.record.family));
  };
  column.load = [](ShardSample& sample, const std::byte* row) {
    const auto value = static_cast<std::int8_t>(*row);
    if (value < -1 || value > 4) throw std::runtime_error(fmt::format("got {}, expected -1 to 4", value));
    sample.record.family = static_cast<Family>(value);
  };
  return {
      "family", "",
      "family of the SMAL shape space: -1 none of the five, 0 Felidae, 1 Canidae, 2 Equidae, 3 Bovidae, 4 "
      "Hippopotamidae",
      std::move(column)};
}

using Columns = std::vector<ShardColumn>;

Columns identity_columns() {
  return {
      text(
          "id", "dataset/split/image#annotation, unique within a build",
          [](auto& s) -> auto& { return s.record.id; }),
      text(
          "dataset", "name of the dataset in the build's config",
          [](auto& s) -> auto& { return s.record.dataset; }),
      text(
          "split", "train, test, ...", [](auto& s) -> auto& { return s.record.split; }),
      text(
          "source", "sub-dataset where the annotation file says, else empty",
          [](auto& s) -> auto& { return s.record.source; }),
      text(
          "species", "lower case, spaces; empty when unknown",
          [](auto& s) -> auto& { return s.record.species; }),
      family(),
      text(
          "image_ref", "the source image as the annotation file names it",
          [](auto& s) -> auto& { return s.record.image_ref; }),
      text(
          "image_sha256", "SHA-256 of the source image's file, hex",
          [](auto& s) -> auto& { return s.image_sha256; }),
  };
}

Columns picture_columns() {
  return {
      numbers<std::int32_t>(
          "image_width_px", {}, "px", "width of the source image as decoded",
          [](auto& s) -> auto& { return s.image_width_px; }),
      numbers<std::int32_t>(
          "image_height_px", {}, "px", "height of the source image as decoded",
          [](auto& s) -> auto& { return s.image_height_px; }),
      numbers<std::int32_t>(
          "annotated_width_px", {}, "px", "width that the annotation states; 0 when it does not",
          [](auto& s) -> auto& { return s.record.width_px; }),
      numbers<std::int32_t>(
          "annotated_height_px", {}, "px", "height that the annotation states; 0 when it does not",
          [](auto& s) -> auto& { return s.record.height_px; }),
      numbers<double>(
          "box_xywh_px", {4}, "px", "the animal's box in the source image: left, top, width, height",
          [](auto& s) -> auto& { return s.record.box; }),
      numbers<double>(
          "patch_box_px", {3}, "px",
          "the network's square crop in the source image: centre x, centre y, side",
          [](auto& s) -> auto& { return s.patch_box; }),
      bytes("crop",
            "the stored crop, encoded as the attribute image_encoding says, RGB; empty in a reference shard",
            &ShardSample::crop),
      bytes("crop_mask",
            "the animal's silhouette in the stored crop, 8-bit grey PNG (255 inside, 0 outside); empty when "
            "there is none",
            &ShardSample::crop_mask),
      numbers<std::int32_t>(
          "crop_side_px", {}, "px", "side of the stored crop; 0 when there is none",
          [](auto& s) -> auto& { return s.crop_side_px; }),
      numbers<double>(
          "crop_from_image", {2, 3}, "px",
          "affine map: (x, y) of the stored crop = M (x, y, 1) of the source image",
          [](auto& s) -> auto& { return s.crop_from_image; }),
  };
}

Columns keypoint_columns() {
  return {
      keypoint_numbers<double, 2>(
          "keypoints_px", {kNumKeypoints, 2}, "px",
          "annotated 2D keypoints in the source image; with `resized: scale` they are scaled to it",
          {&Keypoint::x_px, &Keypoint::y_px}),
      keypoint_numbers<float, 1>("keypoints_v", {kNumKeypoints}, "",
                                 "the annotation file's own visibility or likelihood, verbatim",
                                 {&Keypoint::v}),
      keypoint_numbers<float, 1>("keypoints_weight", {kNumKeypoints}, "",
                                 "0 when not labelled, else 1 or the likelihood; visible means > 0",
                                 {&Keypoint::weight}),
  };
}

Columns verdict_columns() {
  return {
      names(
          "label_kind", "what the label is: truth, retained, refined or 2d_only",
          [](auto& s) -> auto& { return s.label_kind; }, label_kind_from_string),
      names(
          "verdict", "where the candidate ended: retained, refined, discarded or failed",
          [](auto& s) -> auto& { return s.judgement.verdict; }, verdict_from_string),
      names(
          "reason", "why it was discarded or failed; none for kept samples",
          [](auto& s) -> auto& { return s.judgement.reason; }, reason_from_string),
      text(
          "detail", "the reason in words, or a remark on a kept sample",
          [](auto& s) -> auto& { return s.judgement.detail; }),
      numbers<double>(
          "initial_error", {}, "crop units", "L_proj of the network's prediction; NaN when not computed",
          [](auto& s) -> auto& { return s.judgement.initial_error; }),
      numbers<double>(
          "final_error", {}, "crop units", "L_proj of the label; NaN when not computed",
          [](auto& s) -> auto& { return s.judgement.final_error; }),
      numbers<double>(
          "gain", {}, "", "relative gain within the first adaptation iterations; NaN when not adapted",
          [](auto& s) -> auto& { return s.judgement.gain; }),
      numbers<std::int32_t>(
          "iterations", {}, "", "adaptation iterations taken",
          [](auto& s) -> auto& { return s.judgement.iterations; }),
      numbers<std::int32_t>(
          "best_iteration", {}, "", "the iterate that was kept; 0 is the prediction itself",
          [](auto& s) -> auto& { return s.judgement.best_iteration; }),
  };
}

Columns trust_columns() {
  Columns columns;
  for (const TrustColumn& each : kTrustColumns) {
    columns.push_back(numbers<double>(
        each.name, {}, each.units,
        each.meaning, [score = each.score](auto& s) -> auto& { return s.judgement.trust.*score; }));
    columns.back().since = 2;
  }
  return columns;
}

Columns label_columns() {
  return {
      flag("has_pose", "1 when pose is a label", &ShardSample::has_pose),
      flag("has_betas", "1 when betas is a label", &ShardSample::has_betas),
      flag("has_keypoints_3d", "1 when keypoints_3d is a label", &ShardSample::has_keypoints_3d),
      numbers<float>(
          "pose", {kNumJoints, 3, 3}, "", "rotation matrices; joint 0 is the global orientation",
          [](auto& s) -> auto& { return s.body.pose; }),
      numbers<float>(
          "betas", {kNumBetas}, "", "SMAL shape coefficients", [](auto& s) -> auto& { return s.body.betas; }),
      numbers<float>(
          "camera", {3}, "", "weak-perspective camera (s, tx, ty)",
          [](auto& s) -> auto& { return s.body.camera; }),
      numbers<float>(
          "trans", {3}, "SMAL units", "translation of the body in the camera frame",
          [](auto& s) -> auto& { return s.body.translation; }),
      numbers<float>(
          "keypoints_3d", {kNumKeypoints, 3}, "SMAL units", "3D keypoints of the body before trans is added",
          [](auto& s) -> auto& { return s.keypoints_3d; }),
      numbers<float>(
          "projected_2d", {kNumKeypoints, 2}, "crop units",
          "keypoints_3d + trans, projected into the network's crop",
          [](auto& s) -> auto& { return s.projected_2d; }),
  };
}

Columns truth_columns() {
  return {
      flag(
          "truth_present", "1 when the annotation file gives a body; the truth_ columns are 0 without one",
          [](const ShardSample& s) { return s.record.truth.has_value(); },
          [](ShardSample& s, bool present) {
            if (present) s.record.truth.emplace();
          }),
      truth_flag("truth_has_pose", "1 when truth_pose is given", &BodyTruth::has_pose),
      truth_flag("truth_has_betas", "1 when truth_betas is given", &BodyTruth::has_betas),
      truth_flag("truth_has_keypoints_3d", "1 when truth_keypoints_3d is given",
                 &BodyTruth::has_keypoints_3d),
      truth_numbers("truth_pose", {kNumJoints, 3}, "rad",
                    "axis-angle rotations; joint 0 is the global orientation", &BodyTruth::pose_axis_angle),
      truth_numbers("truth_betas", {kNumBetas}, "", "SMAL shape coefficients", &BodyTruth::betas),
      truth_numbers("truth_trans", {3}, "SMAL units",
                    "translation of the body as the annotation file gives it", &BodyTruth::trans),
      truth_numbers("truth_keypoints_3d", {kNumKeypoints, 3}, "SMAL units",
                    "3D keypoints as the annotation file gives them", &BodyTruth::keypoints_3d),
  };
}

}  // namespace

const std::vector<ShardColumn>& shard_columns() {
  static const Columns columns = [] {
    Columns all;
    for (Columns& group : std::array{identity_columns(), picture_columns(), keypoint_columns(),
                                     verdict_columns(), trust_columns(), label_columns(), truth_columns()}) {
      std::move(group.begin(), group.end(), std::back_inserter(all));
    }
    return all;
  }();
  return columns;
}

std::string dtype_of(const ShardColumn& column) {
  if (const auto* number = std::get_if<NumberColumn>(&column.content))
    return std::string(to_string(number->type));
  return std::holds_alternative<TextColumn>(column.content) ? "text" : "bytes";
}

std::string shape_of(const ShardColumn& column) {
  std::string shape = "(rows";
  if (const auto* number = std::get_if<NumberColumn>(&column.content)) {
    for (const std::int64_t extent : number->row_shape) shape += fmt::format(", {}", extent);
  }
  return shape + ")";
}

}  // namespace q3d::manifests
