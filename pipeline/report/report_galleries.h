// Chooses and draws the pictures of the report: candidates that are worth looking at, with the text of
// `explain`.
#pragma once

#include <nlohmann/json.hpp>

#include <cstddef>
#include <string>
#include <vector>

#include "pipeline/report/overlay_painter.h"
#include "pipeline/report/source_files.h"

namespace q3d::pipeline::report {

// One gallery before it is drawn.
struct GalleryPlan {
  std::string title;
  std::string meaning;
  std::vector<dataset::VerdictRow> rows;
};

// Returns the galleries of the best and the worst labels, of the candidates nearest to tau_low, tau_high and
// delta, and of random ones, with at most `size` rows each. The random choice depends only on the candidates'
// ids, so the same dataset always gives the same galleries.
std::vector<GalleryPlan> plan_galleries(const dataset::PublishedDataset& dataset,
                                        const std::vector<dataset::VerdictRow>& rows, std::size_t size);

// [{title, meaning, open, panels: [names], cards: [{id, line, why, story, picture, width, height}]}]. A
// picture is a data URI of a JPEG; `story` is the text of `explain`. Galleries without rows are left out.
nlohmann::ordered_json draw_galleries(const dataset::PublishedDataset& dataset, const SourceFiles& files,
                                      const OverlayPainter& painter, const std::vector<GalleryPlan>& plans);

}  // namespace q3d::pipeline::report
