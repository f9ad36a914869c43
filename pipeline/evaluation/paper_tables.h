// Shows an evaluation in the layout of the paper's tables, beside the paper's numbers.
#pragma once

#include <string>

#include "pipeline/evaluation/tables.h"

namespace q3d::pipeline::evaluation {

// Returns the tables of Yu, Wang and Mathis (arXiv:2606.02366) as Markdown: the sets with bodies, the sets
// with 2D keypoints, the ablations, before and after adaptation, by family, and the clusters of shapes. A row
// of this evaluation follows the paper's rows. A cell is "-" if the evaluation lacks it. A dataset is found
// by its name in the config: animal3d, ctrlani3d, superanimal or quadruped2d, animal_kingdom. Each table ends
// with a line on what may be compared. `is_rendered`: the pictures come from `sample`.
std::string paper_tables(const Tables& tables, bool is_rendered);

}  // namespace q3d::pipeline::evaluation
