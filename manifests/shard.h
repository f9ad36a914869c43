// The shard of a published dataset, with its writer (schema 2) and its reader (schemas 1 and 2).
// docs/shard-format.md describes it.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/image_encoding.h"
#include "manifests/sample.h"
#include "manifests/table_reader.h"
#include "manifests/verdict.h"
#include "smal/body.h"
#include "smal/keypoints.h"

namespace q3d::manifests {

inline constexpr int kShardSchema = 2;  // the schema that is written; earlier ones can be read

// One labelled sample. A record that is read from a shard has no absolute paths. Pixel quantities are pixels
// of the source image unless stated otherwise. Crop units are those of the network's crop (side 1, range
// [-0.5, 0.5]).
struct ShardSample {
  SampleRecord record;
  std::string image_sha256;  // digest of the source file
  LabelKind label_kind = LabelKind::retained;
  Judgement judgement;

  // Source image and stored crop. The stored crop covers `crop_scale` times the box's longer side; it is
  // absent (0 bytes) when the shard only refers to images.
  int image_width_px = 0;
  int image_height_px = 0;
  std::vector<std::byte> crop;       // encoded picture (JPEG or PNG), RGB
  std::vector<std::byte> crop_mask;  // encoded 8-bit PNG, empty when there is no mask
  int crop_side_px = 0;
  std::array<double, 6> crop_from_image{};  // 2x3 affine, image px -> stored-crop px
  std::array<double, 3> patch_box{};        // centre x, centre y, side: the network's square crop, image px

  // The label. The body's translation is not yet added to keypoints_3d.
  bool has_pose = false;
  bool has_betas = false;
  bool has_keypoints_3d = false;
  smal::Body body;
  smal::Keypoints3d keypoints_3d{};
  smal::CropPoints projected_2d{};  // keypoints of the body
};

// The terms under which the pictures and annotations of a source dataset came, in the words of the build's
// config. A text is empty where the config says nothing.
struct DatasetTerms {
  std::string licence{};
  std::string source_url{};
  std::string citation{};
  bool operator==(const DatasetTerms&) const = default;
};

struct ShardHeader {
  int schema = kShardSchema;
  std::string dataset;  // name of the build
  std::string version;  // config key of the build
  std::int64_t unit = 0;
  ImageEncoding image_encoding = ImageEncoding::jpeg;
  std::map<std::string, DatasetTerms> datasets{};  // by "dataset/split"; empty in schema 1
};

// Writes one shard atomically and returns its SHA-256. Equal input gives equal bytes. Absolute paths are not
// written. The attribute keypoint_names is kKeypointNames. Throws std::runtime_error that names the path
// (disk full, ...). Throws std::invalid_argument that names a sample which cannot be in a shard: a failed
// record, a crop in a shard of references, or no crop in another one.
std::string write_shard(const std::filesystem::path& path, const ShardHeader& header,
                        const std::vector<ShardSample>& samples);

// An open shard. Reads take no lock, so many threads may read at once.
class ShardReader {
 public:
  // Checks magic, schema and completeness, in that order, and refuses a file that it does not know. Throws
  // std::runtime_error that names path and dataset, what was found, what was expected and what to do.
  explicit ShardReader(const std::filesystem::path& path);

  const ShardHeader& header() const { return header_; }
  std::int64_t rows() const { return table_.rows(); }
  // Gives access to single columns of some rows.
  const TableReader& table() const { return table_; }
  // Returns the rows [first, first + count) with all columns. Throws std::out_of_range for rows that the
  // shard lacks, and std::runtime_error that names path, column and row for a value that the schema does not
  // know. Fields that schema 1 lacks keep their defaults; trust scores are NaN.
  std::vector<ShardSample> samples(std::int64_t first, std::int64_t count) const;

 private:
  ShardHeader header_;
  TableReader table_;
};

struct Shard {
  ShardHeader header;
  std::vector<ShardSample> samples;
};
Shard read_shard(const std::filesystem::path& path);  // the whole shard; throws like ShardReader

}  // namespace q3d::manifests
