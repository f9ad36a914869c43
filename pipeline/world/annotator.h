// The annotator labels what it sees as people do: it misses, guesses and confuses points, or places them a
// little off.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "manifests/random.h"
#include "pipeline/world/landmarks.h"

namespace q3d::pipeline::world {

// The truth about a landmark in a picture.
struct SeenLandmark {
  Eigen::Vector2d px{0.0, 0.0};
  bool exists = false;
  bool inside = false;       // of the picture
  bool self_hidden = false;  // behind the animal's own body
  bool occluded = false;     // behind something in front of the animal
};

// Rates at which points are labelled, by what can be seen of them, and errors. The rates are ours: no dataset
// reports them. Labelled shares of real files guided them (Animal Kingdom's mammals: 65 % of all points).
struct LabelHabits {
  double visible = 0.97;
  double self_hidden = 0.65;  // people know where the far leg is
  double occluded = 0.35;
  double swapped = 0.03;      // share of animals with left and right confused somewhere
  double jitter = 0.006;      // deviation of a clear point, share of the box's longer side
  double vague_factor = 2.0;  // the same for a vague point, over that of a clear one
};

struct Label {
  double x_px = 0.0, y_px = 0.0;
  bool given = false;
};

// One label a landmark. Swaps exchange the two sides of the fore legs, the hind legs, the face, or all.
std::vector<Label> annotate(const std::vector<Landmark>& landmarks, std::span<const SeenLandmark> seen,
                            double box_side_px, const LabelHabits& habits, manifests::Rng& rng);

}  // namespace q3d::pipeline::world
