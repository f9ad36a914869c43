// One candidate with all that an overlay shows of it: its picture, its keypoints and its bodies.
#pragma once

#include <opencv2/core.hpp>

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "loaders/pictures/crop.h"
#include "manifests/sample.h"
#include "pipeline/dataset/published_dataset.h"
#include "pipeline/device/network.h"
#include "pipeline/report/source_files.h"

namespace q3d::pipeline::report {

// A picture with the map from the pixels of the source image to its own pixels.
struct MappedPicture {
  cv::Mat rgb;  // 8-bit, 3 channels; empty where no picture was found
  loaders::pictures::Affine from_image{};
};

struct OverlaySubject {
  dataset::VerdictRow row;
  std::string why;                 // what decided, as `explain` says it; empty where it is not known
  manifests::SampleRecord record;  // id, box and keypoints; no more is set
  bool has_geometry = false;       // whether box and keypoints were found
  cv::Size image_size;             // px of the picture that box and keypoints are of
  MappedPicture picture;
  std::string no_picture;  // why there is none; empty where there is one

  // Bodies in the camera of the network's crop. Each is there only if its projection is.
  std::optional<device::BodyPrediction> prediction;  // what the network gave; not of annotated bodies
  std::optional<device::BodyPrediction> label;       // what went into the dataset
  std::optional<device::BodyPrediction> dropped;     // adapted, and then discarded

  // The body that decided: the label, else the dropped one, else the prediction. Null where there is none.
  const device::BodyPrediction* shown() const;
  loaders::pictures::SquareBox box() const { return loaders::pictures::square_box(record.box); }
};

// Reads the subjects of these rows, in their order. Each unit's tables are read once. A candidate of which
// little is left (no picture, no prediction) still has a subject, which says what is missing. Throws
// std::runtime_error for a stage table or a shard that is damaged, and manifests::IoError.
std::vector<OverlaySubject> read_subjects(const dataset::PublishedDataset& dataset, const SourceFiles& files,
                                          std::span<const dataset::VerdictRow> rows);

// The subject of a shard's sample: its picture, keypoints and label.
OverlaySubject subject_of(const manifests::ShardSample& sample);

}  // namespace q3d::pipeline::report
