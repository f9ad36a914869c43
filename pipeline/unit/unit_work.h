// The item that travels through the flow graph: a unit with the results of its stages so far.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "filters/guards.h"
#include "loaders/pictures/stored_crop.h"
#include "manifests/verdict.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/device/network.h"

namespace q3d::pipeline::unit {

// The result of predict for one candidate: the body from which its label is made, or why it failed. The body
// comes from the network or, depending on the role, from the annotation file.
struct PredictedSample {
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;  // text of the failure, or a remark (a mask that was left out)
  int image_width_px = 0;
  int image_height_px = 0;
  bool has_mask = false;
  device::BodyPrediction body;  // valid if failure is none; no_body() for 2d_only
};

// The result of refine for one candidate of the middle band.
struct RefinedSample {
  std::size_t sample = 0;              // position within the unit
  std::vector<double> curve;           // L_proj of iterates 0..n, crop units
  device::BodyPrediction body;         // the iterate of least L_proj, or of least held-out error
  std::vector<double> held_out_curve;  // error of the held-out keypoints for the same iterates, if any
};

// The measurements of one candidate that the fidelity rule keeps: all trust scores but the combined one.
struct MeasuredLabel {
  std::size_t sample = 0;  // position within the unit
  manifests::TrustScores scores;
};

// The stored crop of a candidate, as its shard holds it.
struct EncodedCrop {
  std::size_t sample = 0;              // position within the unit
  std::vector<std::byte> picture;      // JPEG or PNG; empty where shards only refer to pictures
  std::vector<std::byte> mask;         // PNG; empty where there is none
  int side_px = 0;                     // of the square crop
  std::array<double, 6> from_image{};  // 2x3 affine, image px -> crop px
};

// The parts of a decoded picture that later steps need.
struct DecodedSample {
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;
  int image_width_px = 0;
  int image_height_px = 0;
  bool has_mask = false;
  std::vector<std::uint8_t> patch;       // 256 x 256 x 3 RGB: the network's crop
  double mask_area_px = 0.0;             // of the patch, when asked for; 0 = no silhouette in it
  std::vector<std::uint8_t> patch_mask;  // 256 x 256, the patch's silhouette, when asked for; empty without
  std::optional<loaders::pictures::StoredCrop> stored_crop;  // pixels, when asked for; freed once encoded
};

struct UnitWork {
  const candidates::Unit* unit = nullptr;
  std::vector<candidates::Candidate> own_candidates;  // storage of the next member, in an item of open_unit()
  std::span<const candidates::Candidate> candidates;  // candidates of the unit; see set_candidates
  std::vector<device::CropKeypoints> keypoints;       // by position: the annotated ones, in the crop

  // Each is loaded if an earlier run had finished the stage, and else filled by the stage's node.
  std::optional<std::vector<PredictedSample>> predicted;
  std::optional<std::vector<RefinedSample>> refined;
  std::optional<std::vector<MeasuredLabel>> measured;
  bool predicted_before = false;
  bool refined_before = false;
  bool measured_before = false;
  bool shard_before = false;

  // L_proj of the bodies in `predicted` by position, in crop units. It is NaN if the candidate failed, if no
  // keypoint is visible, or if the body has no projection.
  std::vector<double> errors;
  // The features, by position, of the candidates that the rule adapts. predict_unit fills them and
  // refine_unit frees them. They are empty in a resumed run, which encodes these pictures again.
  std::vector<device::KeptFeatures> features;
  std::vector<DecodedSample> decoded;            // by position; freed once the stored crops are encoded
  std::vector<manifests::Judgement> judgements;  // by position

  // The crops of the candidates that this build or an earlier one kept, in the order of `sample`.
  std::vector<EncodedCrop> crops;
  std::size_t crops_encoded = 0;  // how many of them were encoded in this run
};

// Sets work.candidates and computes work.keypoints. `candidates` must outlive the work. The keypoints of a
// failed record are zeros.
void set_candidates(UnitWork& work, std::span<const candidates::Candidate> candidates);

// Returns a new item for one unit of the pool, with its candidates read and set. `ingest` must outlive it.
// Throws manifests::IoError.
std::shared_ptr<UnitWork> open_unit(const candidates::Ingest& ingest, std::int64_t index);

// Sets work.predicted and computes work.errors. Needs the candidates.
void set_predictions(UnitWork& work, std::vector<PredictedSample> samples);

// Returns the stored crop of the candidate at this position, or null if none has been encoded.
const EncodedCrop* find_crop(const UnitWork& work, std::size_t sample);

}  // namespace q3d::pipeline::unit
