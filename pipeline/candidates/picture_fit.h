// Compares the statements of annotation files about their pictures with the pictures themselves.
#pragma once

#include <vector>

#include "loaders/formats/notes.h"
#include "manifests/sample.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::candidates {

// Reads the header of every picture, in parallel, and compares its size with the stated one. No picture is
// decoded.
// - A record whose picture has more than `max_picture_megapixels` fails as `image_too_large`.
// - With `orientation: exif`, the record gets the picture's EXIF orientation, by which the picture is turned
// when
//   it is decoded. Box and keypoints stay: they were made on the turned picture.
// - A record whose stated size is another than the picture's fails as `size_mismatch`; the detail says which
// key
//   may be meant. With `resized: scale`, box and keypoints are scaled if width and height differ by one
//   factor.
// - A record whose labels cannot be meant on this picture fails (label_checks.h).
// - A record that failed as `no_visible_keypoints` is fitted like the others, since corrections may give it
//   keypoints. It keeps its reason unless its picture is too large or has another size. Other failed records
//   stay as they are.
// The notes say how many pictures have an EXIF orientation that is not used, how many records were scaled,
// and how many have keypoints outside their picture. Records of pictures without a readable header are
// unchanged; decoding reports what is wrong. Throws manifests::IoError for a picture that exists and cannot
// be read, and Interrupted.
class PictureFit {
 public:
  // `options` must outlive it.
  explicit PictureFit(const config::DatasetConfig& options) : options_(options) {}

  void fit(std::vector<manifests::SampleRecord>& records);
  // Returns the notes on all records that were fitted so far.
  std::vector<loaders::formats::Note> notes() const { return notes_.list(); }

 private:
  const config::DatasetConfig& options_;
  loaders::formats::Notes notes_;
};

}  // namespace q3d::pipeline::candidates
