// Draws overlays, which show the bodies of one candidate over its photograph in panels side by side.
#pragma once

#include <opencv2/core.hpp>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/device/body_meshes.h"
#include "pipeline/report/mesh_painter.h"
#include "pipeline/report/overlay_subject.h"

namespace q3d::pipeline::report {

enum class Panel : std::uint8_t {
  photo,
  prediction,  // the network's body over the photo, blue
  label,       // the dataset's body over the photo, orange; for a discarded candidate, its adapted body
  side,        // the body that decided, seen from the side
  keypoints,   // annotated keypoints and the projections of the body that decided
};
inline constexpr std::array<Panel, 5> kAllPanels{Panel::photo, Panel::prediction, Panel::label, Panel::side,
                                                 Panel::keypoints};
std::string_view to_string(Panel panel);
Panel panel_from_string(std::string_view name);  // throws std::invalid_argument on an unknown name

// Panels are square and show this many times the network's crop, so that one can see a box that cuts off the
// animal.
inline constexpr double kPanelContext = 1.2;
inline constexpr int kPanelSidePx = 300;

// Returns the photograph in a square tile that shows kPanelContext times the crop. The tile is grey with the
// reason if there is no picture.
cv::Mat photo_tile(const OverlaySubject& subject, int side_px);

// The posed meshes of one subject, in the frame of its crop's camera.
struct PosedBodies {
  std::optional<Vertices> prediction;
  std::optional<Vertices> label;  // or the dropped body
  const Vertices* shown() const;  // the label, else the prediction; null if there is neither
};

class OverlayPainter {
 public:
  // Without a body model (null), no body is drawn, and the panels say so. `bodies` must outlive the painter.
  explicit OverlayPainter(const device::BodyMeshes* bodies);

  PosedBodies pose(const OverlaySubject& subject) const;

  // Returns one square panel, 8-bit RGB. A panel that has nothing to show is grey and says why.
  cv::Mat panel(const OverlaySubject& subject, const PosedBodies& bodies, Panel panel,
                int side_px = kPanelSidePx) const;
  // Returns the panels side by side, without text.
  cv::Mat row(const OverlaySubject& subject, std::span<const Panel> panels, int side_px = kPanelSidePx) const;
  // Returns the row with the panels' titles above it, and above these the whole id, the verdict with its
  // numbers, and the reason for it.
  cv::Mat captioned(const OverlaySubject& subject, std::span<const Panel> panels) const;

  // Draws a body into a tile that photo_tile has made.
  void draw_body(cv::Mat& tile, const Vertices& vertices, const cv::Scalar& colour) const;
  const std::vector<std::array<std::int32_t, 3>>& faces() const { return faces_; }

 private:
  const device::BodyMeshes* bodies_;
  std::vector<std::array<std::int32_t, 3>> faces_;
  MeshPainter painter_;
};

// Draws the legend of the colours in these panels as a strip of this width. The strip is empty if nothing
// needs an explanation.
cv::Mat overlay_legend(std::span<const Panel> panels, int width_px);

// Returns a sheet with the pictures in `columns` columns, each as wide as the widest, and the legend of their
// panels at the end. Throws std::invalid_argument if there are no pictures.
cv::Mat overlay_sheet(const std::vector<cv::Mat>& pictures, std::span<const Panel> panels, int columns);

// Returns the verdict in one line: "discarded (gain_too_small): lion, felidae; L_proj 0.061 -> 0.055, gain
// 3.1 %".
std::string verdict_line(const dataset::VerdictRow& row);

}  // namespace q3d::pipeline::report
