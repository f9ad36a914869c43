// A candidate with everything that an overlay shows: its picture, its keypoints and its bodies.
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
  std::string why;                 // the grounds of the verdict, as in `explain`; empty if unknown
  manifests::SampleRecord record;  // id, box and keypoints; no more is set
  bool has_geometry = false;       // whether box and keypoints were found
  cv::Size image_size;             // px of the picture to which box and keypoints refer
  MappedPicture picture;
  std::string no_picture;  // the reason why there is no picture; empty if there is one

  // Bodies in the camera of the network's crop. A body is set only if its projection exists.
  std::optional<device::BodyPrediction> prediction;  // what the network gave; not of annotated bodies
  std::optional<device::BodyPrediction> label;       // the body in the dataset
  std::optional<device::BodyPrediction> dropped;     // adapted, and then discarded

  // Returns the body that decided the verdict: the label, else the dropped one, else the prediction. Null if
  // there is none.
  const device::BodyPrediction* shown() const;
  loaders::pictures::SquareBox box() const { return loaders::pictures::square_box(record.box); }
};

// Reads the subjects of these rows, in their order. Each unit's tables are read once. A candidate without
// picture or prediction still has a subject, which says what is missing. Throws std::runtime_error for a
// stage table or a shard that is damaged, and manifests::IoError.
std::vector<OverlaySubject> read_subjects(const dataset::PublishedDataset& dataset, const SourceFiles& files,
                                          std::span<const dataset::VerdictRow> rows);

// Returns the subject of a shard's sample: its picture, keypoints and label.
OverlaySubject subject_of(const manifests::ShardSample& sample);

}  // namespace q3d::pipeline::report
