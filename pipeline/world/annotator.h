// The annotator labels pictures as people do: it misses, guesses and confuses points, or places them slightly
// off.
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
  bool inside = false;       // inside the picture
  bool self_hidden = false;  // behind the animal's own body
  bool occluded = false;     // behind something in front of the animal
};

// The rates at which points are labelled, depending on their visibility, and the annotator's errors. The
// rates are our own estimates, because no dataset reports them. Labelled shares of real files guided them
// (Animal Kingdom's mammals: 65 % of all points).
struct LabelHabits {
  double visible = 0.97;
  double self_hidden = 0.65;  // people can guess where the far leg is
  double occluded = 0.35;
  double swapped = 0.03;      // share of animals with left and right confused somewhere
  double jitter = 0.006;      // deviation of a clear point, share of the box's longer side
  double vague_factor = 2.0;  // deviation of a vague point, relative to that of a clear one
};

struct Label {
  double x_px = 0.0, y_px = 0.0;
  bool given = false;
};

// Returns one label for each landmark. A swap exchanges the two sides of the fore legs, the hind legs, the
// face, or everything.
std::vector<Label> annotate(const std::vector<Landmark>& landmarks, std::span<const SeenLandmark> seen,
                            double box_side_px, const LabelHabits& habits, manifests::Rng& rng);

}  // namespace q3d::pipeline::world
