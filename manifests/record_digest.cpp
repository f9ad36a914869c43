// The canonical serialisation is tagged with its version. It has the members in the order below, text with
// its length before it, and numbers as little-endian bits with one bit pattern for NaN.
#include <bit>
#include <cmath>
#include <limits>
#include <vector>

#include "manifests/digest.h"
#include "manifests/record_json.h"

namespace q3d::manifests {
namespace {

static_assert(std::endian::native == std::endian::little, "digests and shards are little-endian");

class Serialiser {
 public:
  void text(std::string_view value) {
    integer(static_cast<std::int64_t>(value.size()));
    append(std::as_bytes(std::span(value)));
  }
  void integer(std::int64_t value) { append(std::as_bytes(std::span(&value, 1))); }
  template <typename T>
  void real(T value) {
    if (std::isnan(value)) value = std::numeric_limits<T>::quiet_NaN();
    append(std::as_bytes(std::span(&value, 1)));
  }
  template <typename T, std::size_t N>
  void reals(const std::array<T, N>& values) {
    for (const T value : values) real(value);
  }
  std::string digest() const { return sha256(bytes_); }

 private:
  void append(std::span<const std::byte> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  std::vector<std::byte> bytes_;
};

}  // namespace

std::string record_digest(const SampleRecord& record) {
  Serialiser out;
  out.text("quadruped3d sample record 1");
  for (const auto* text :
       {&record.id, &record.dataset, &record.split, &record.source, &record.species, &record.image_ref}) {
    out.text(*text);
  }
  out.integer(static_cast<std::int64_t>(record.family));
  out.integer(record.mask_path.empty() ? 0 : 1);
  out.integer(record.width_px);
  out.integer(record.height_px);
  out.reals(std::array{record.box.x_px, record.box.y_px, record.box.w_px, record.box.h_px});
  for (const Keypoint& keypoint : record.keypoints) {
    out.reals(std::array{keypoint.x_px, keypoint.y_px});
    out.reals(std::array{keypoint.v, keypoint.weight});
  }
  out.integer(record.truth ? 1 : 0);
  if (record.truth) {
    out.integer(record.truth->has_pose);
    out.integer(record.truth->has_betas);
    out.integer(record.truth->has_keypoints_3d);
    out.reals(record.truth->pose_axis_angle);
    out.reals(record.truth->betas);
    out.reals(record.truth->trans);
    out.reals(record.truth->keypoints_3d);
  }
  out.text(to_string(record.failure));
  if (record.orientation != 1 || record.scale != 1.0) {
    out.integer(record.orientation);
    out.real(record.scale);
  }
  return out.digest();
}

}  // namespace q3d::manifests
