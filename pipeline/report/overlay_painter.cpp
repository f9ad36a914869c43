#include "pipeline/report/overlay_painter.h"

#include <fmt/format.h>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "loaders/pictures/stored_crop.h"
#include "pipeline/report/keypoint_painter.h"
#include "pipeline/report/lettering.h"
#include "pipeline/unit/crop_keypoints.h"

namespace q3d::pipeline::report {
namespace {

constexpr double kOpacity = 0.85;
constexpr int kGapPx = 4;
constexpr int kNamedErrors = 3;

constexpr std::array<std::string_view, kAllPanels.size()> kPanelNames{"photo", "prediction", "label", "side",
                                                                      "keypoints"};

Vertices in_camera(const device::BodyMesh& mesh, const smal::Translation& translation) {
  const Eigen::Vector3f shift(translation[0], translation[1], translation[2]);
  Vertices vertices;
  vertices.reserve(mesh.vertices.size() / 3);
  for (std::size_t v = 0; v + 2 < mesh.vertices.size(); v += 3) {
    vertices.push_back(Eigen::Vector3f(mesh.vertices[v], mesh.vertices[v + 1], mesh.vertices[v + 2]) + shift);
  }
  return vertices;
}

// Returns a panel that has nothing to show and says why.
cv::Mat empty_panel(const std::string& why, int side_px) {
  cv::Mat tile(side_px, side_px, CV_8UC3, colours::kEmpty);
  int y = side_px / 2 - 20;
  for (const std::string& line : wrapped(why, side_px - 24, TextSize::small)) {
    write(tile, line, {12, y}, TextSize::small, colours::kGrey);
    y += line_height_px(TextSize::small);
  }
  return tile;
}

std::string no_label_text(const OverlaySubject& subject) {
  const manifests::Judgement& judgement = subject.row.judgement;
  if (subject.row.label || judgement.verdict == manifests::Verdict::retained ||
      judgement.verdict == manifests::Verdict::refined) {
    return "the label has no body that can be drawn";
  }
  if (subject.dropped) return "no body model";
  return fmt::format("no label: {} ({})", manifests::to_string(judgement.verdict),
                     manifests::to_string(judgement.reason));
}

std::string title(const OverlaySubject& subject, Panel panel) {
  switch (panel) {
    case Panel::photo:
      return "photo";
    case Panel::prediction:
      return "prediction";
    case Panel::label:
      return !subject.label && subject.dropped ? "adapted, and dropped" : "label";
    case Panel::side:
      return "from the side";
    case Panel::keypoints:
      return fmt::format("keypoints, {} largest errors in %", kNamedErrors);
  }
  throw std::logic_error("no such panel");
}

}  // namespace

std::string_view to_string(Panel panel) {
  return kPanelNames.at(static_cast<std::size_t>(panel));
}

Panel panel_from_string(std::string_view name) {
  const auto found = std::find(kPanelNames.begin(), kPanelNames.end(), name);
  if (found != kPanelNames.end()) return static_cast<Panel>(found - kPanelNames.begin());
  throw std::invalid_argument(
      fmt::format("no panel \"{}\", expected one of photo, prediction, label, side, keypoints", name));
}

const Vertices* PosedBodies::shown() const {
  if (label) return &*label;
  return prediction ? &*prediction : nullptr;
}

OverlayPainter::OverlayPainter(const device::BodyMeshes* bodies)
    : bodies_(bodies),
      faces_(bodies == nullptr ? std::vector<std::array<std::int32_t, 3>>() : bodies->faces()),
      painter_(faces_) {}

PosedBodies OverlayPainter::pose(const OverlaySubject& subject) const {
  const auto posed = [&](const device::BodyPrediction& body) {
    const smal::Body& shape = body;
    return in_camera(bodies_->pose({&shape, 1}).front(), body.translation);
  };
  PosedBodies bodies;
  if (bodies_ == nullptr) return bodies;
  if (subject.prediction) bodies.prediction = posed(*subject.prediction);
  if (subject.label) {
    bodies.label = posed(*subject.label);
  } else if (subject.dropped) {
    bodies.label = posed(*subject.dropped);
  }
  return bodies;
}

cv::Mat photo_tile(const OverlaySubject& subject, int side_px) {
  if (subject.picture.rgb.empty()) return empty_panel(subject.no_picture, side_px);
  const loaders::pictures::Affine tile_from_image =
      loaders::pictures::patch_from_image(subject.box(), side_px, kPanelContext);
  const loaders::pictures::Affine affine =
      loaders::pictures::patch_from_stored_crop(tile_from_image, subject.picture.from_image);
  const cv::Mat matrix(2, 3, CV_64FC1, const_cast<double*>(affine.data()));
  cv::Mat tile;
  cv::warpAffine(subject.picture.rgb, tile, matrix, {side_px, side_px}, cv::INTER_LINEAR,
                 cv::BORDER_CONSTANT);
  return tile;
}

void OverlayPainter::draw_body(cv::Mat& tile, const Vertices& vertices, const cv::Scalar& colour) const {
  painter_.paint(tile, vertices, crop_camera(tile.cols, kPanelContext), colour, kOpacity);
}

cv::Mat OverlayPainter::panel(const OverlaySubject& subject, const PosedBodies& bodies, Panel panel,
                              int side_px) const {
  if (panel == Panel::photo) return photo_tile(subject, side_px);
  const auto over_photo = [&](const std::optional<Vertices>& body, const cv::Scalar& colour,
                              const std::string& otherwise) {
    if (!body) return empty_panel(otherwise, side_px);
    cv::Mat tile = photo_tile(subject, side_px);
    draw_body(tile, *body, colour);
    return tile;
  };
  if (panel == Panel::prediction)
    return over_photo(bodies.prediction, colours::kBlue, "no prediction to draw");
  if (panel == Panel::label) return over_photo(bodies.label, colours::kOrange, no_label_text(subject));
  if (panel == Panel::side) {
    if (bodies.shown() == nullptr) return empty_panel("no body to draw", side_px);
    cv::Mat tile(side_px, side_px, CV_8UC3, colours::kPaper);
    const TileCamera camera = crop_camera(side_px, kPanelContext);
    painter_.paint(tile, side_view(*bodies.shown(), camera, side_px), camera,
                   bodies.label ? colours::kOrange : colours::kBlue, 1.0);
    return tile;
  }
  if (!subject.has_geometry) return empty_panel("the keypoints were not found", side_px);
  cv::Mat tile = photo_tile(subject, side_px);
  const device::BodyPrediction* shown = subject.shown();
  draw_keypoints(tile, unit::crop_keypoints(subject.record), shown ? &shown->keypoints_2d : nullptr,
                 kPanelContext, kNamedErrors);
  return tile;
}

cv::Mat OverlayPainter::row(const OverlaySubject& subject, std::span<const Panel> panels, int side_px) const {
  const PosedBodies bodies = pose(subject);
  const int count = static_cast<int>(panels.size());
  cv::Mat row(side_px, count * side_px + (count - 1) * kGapPx, CV_8UC3, colours::kPaper);
  for (int i = 0; i < count; ++i) {
    panel(subject, bodies, panels[static_cast<std::size_t>(i)], side_px)
        .copyTo(row(cv::Rect(i * (side_px + kGapPx), 0, side_px, side_px)));
  }
  return row;
}

cv::Mat OverlayPainter::captioned(const OverlaySubject& subject, std::span<const Panel> panels) const {
  const cv::Mat pictures = row(subject, panels);
  struct Line {
    std::string text;
    TextSize size;
  };
  std::vector<Line> lines;
  const auto add = [&](const std::string& text, TextSize size) {
    for (std::string& line : wrapped(text, pictures.cols - 8, size)) lines.push_back({std::move(line), size});
  };
  add(subject.row.id, TextSize::normal);
  add(verdict_line(subject.row), TextSize::small);
  if (!subject.why.empty()) add(subject.why, TextSize::small);
  int height = line_height_px(TextSize::small) + kGapPx;  // height of the titles
  for (const Line& line : lines) height += line_height_px(line.size);
  cv::Mat cell(height + pictures.rows, pictures.cols, CV_8UC3, colours::kPaper);
  int y = 0;
  for (const Line& line : lines) {
    write(cell, line.text, {4, y}, line.size);
    y += line_height_px(line.size);
  }
  for (std::size_t i = 0; i < panels.size(); ++i) {
    write(cell, title(subject, panels[i]), {static_cast<int>(i) * (kPanelSidePx + kGapPx) + 4, y},
          TextSize::small, colours::kGrey);
  }
  pictures.copyTo(cell(cv::Rect(0, height, pictures.cols, pictures.rows)));
  return cell;
}

std::string verdict_line(const dataset::VerdictRow& row) {
  const manifests::Judgement& judgement = row.judgement;
  std::string text(manifests::to_string(judgement.verdict));
  if (judgement.reason != manifests::Reason::none) {
    text += fmt::format(" ({})", manifests::to_string(judgement.reason));
  }
  if (!row.species.empty()) text += ": " + row.species;
  if (row.family != manifests::Family::none) text += fmt::format(", {}", manifests::to_string(row.family));
  if (std::isfinite(judgement.initial_error)) {
    text += fmt::format("; L_proj {:.4f}", judgement.initial_error);
    if (judgement.iterations > 0) {
      text += fmt::format(" -> {:.4f} at iteration {} of {}", judgement.final_error, judgement.best_iteration,
                          judgement.iterations);
    }
  }
  if (std::isfinite(judgement.gain)) text += fmt::format(", gain {:.1f} %", 100.0 * judgement.gain);
  return text;
}

}  // namespace q3d::pipeline::report
