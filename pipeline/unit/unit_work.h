// The one item that travels through the flow graph: a unit and what the stages have made of it so far.
#pragma once

#include <optional>
#include <vector>

#include "filters/guards.h"
#include "loaders/pictures/crop.h"
#include "manifests/verdict.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/device/network.h"

namespace q3d::pipeline::unit {

// What predict knows of one candidate: the body of its label to be, from the network or, by its role, from
// the annotation file; or why it failed.
struct PredictedSample {
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;  // of the failure, or a remark (a mask that was left out)
  int image_width_px = 0;
  int image_height_px = 0;
  bool has_mask = false;
  device::BodyPrediction body;  // meaningful when failure is none; no_body() for 2d_only
};

// What refine knows of one candidate of the middle band.
struct RefinedSample {
  std::size_t sample = 0;              // position within the unit
  std::vector<double> curve;           // L_proj of iterates 0..n, crop units
  device::BodyPrediction body;         // the iterate of least L_proj, or of least held-out error
  std::vector<double> held_out_curve;  // the held-out keypoints' error of the same iterates; empty without
};

// What the guards look at, of one candidate that the fidelity rule keeps.
struct MeasuredLabel {
  std::size_t sample = 0;  // position within the unit
  filters::LabelMeasures measures;
};

// A decoded picture, as far as later stages need it.
struct DecodedSample {
  bool decoded = false;
  manifests::Reason failure = manifests::Reason::none;
  std::string detail;
  int image_width_px = 0;
  int image_height_px = 0;
  bool has_mask = false;
  std::vector<std::uint8_t> patch;       // 256 x 256 x 3 RGB: the network's crop
  double mask_area_px = 0.0;             // of the patch, when asked for; 0 = no silhouette in it
  std::vector<std::uint8_t> patch_mask;  // 256 x 256, the patch's silhouette, when asked for; empty without
  std::vector<std::byte> stored_crop;    // encoded; empty when not asked for
  std::vector<std::byte> stored_mask;
  int stored_side_px = 0;
  std::array<double, 6> stored_from_image{};
};

struct UnitWork {
  const candidates::Unit* unit = nullptr;
  std::span<const candidates::Candidate> candidates;  // the unit's own

  // Filled from the journal where an earlier run had finished the stage, else by the stage's node.
  std::optional<std::vector<PredictedSample>> predicted;
  std::optional<std::vector<RefinedSample>> refined;
  std::optional<std::vector<MeasuredLabel>> measured;  // nothing as long as no guard needs it
  bool predicted_before = false;
  bool refined_before = false;
  bool measured_before = false;
  bool shard_before = false;

  std::vector<DecodedSample> decoded;            // by position; freed once the shard is written
  std::vector<manifests::Judgement> judgements;  // by position
};

}  // namespace q3d::pipeline::unit
