#include "pipeline/world/foreground.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace q3d::pipeline::world {
namespace {

// A picture of the occluder alone, with its coverage.
struct Layer {
  cv::Mat colour;
  cv::Mat1b cover;

  explicit Layer(cv::Size size) : colour(size, CV_8UC3, cv::Scalar(0, 0, 0)), cover(size, std::uint8_t{0}) {}
  void polygon(const std::vector<cv::Point>& outline, const Colour& paint) {
    const std::vector<std::vector<cv::Point>> outlines{outline};
    cv::fillPoly(colour, outlines, to_bgr(paint), cv::LINE_8);
    cv::fillPoly(cover, outlines, cv::Scalar(255), cv::LINE_AA);
  }
  void line(cv::Point from, cv::Point to, const Colour& paint, int thickness) {
    cv::line(colour, from, to, to_bgr(paint), thickness + 1, cv::LINE_8);
    cv::line(cover, from, to, cv::Scalar(255), thickness, cv::LINE_AA);
  }
  void ellipse(cv::Point centre, cv::Size axes, double degrees, const Colour& paint) {
    cv::ellipse(colour, centre, axes + cv::Size(1, 1), degrees, 0, 360, to_bgr(paint), cv::FILLED,
                cv::LINE_8);
    cv::ellipse(cover, centre, axes, degrees, 0, 360, cv::Scalar(255), cv::FILLED, cv::LINE_AA);
  }
  void soften(double sigma) {
    // Blur the colour multiplied by the cover, and then divide, so that no colour bleeds in from the empty
    // part.
    cv::Mat weight, product, soft_weight;
    cv::cvtColor(cover, weight, cv::COLOR_GRAY2BGR);
    cv::multiply(colour, weight, product, 1.0 / 255.0, CV_32F);
    cv::GaussianBlur(product, product, {}, sigma);
    cv::GaussianBlur(cover, cover, {}, sigma);
    cv::cvtColor(cover, weight, cv::COLOR_GRAY2BGR);
    weight.convertTo(soft_weight, CV_32F, 1.0 / 255.0, 1e-3);
    cv::divide(product, soft_weight, product);
    product.convertTo(colour, CV_8U);
  }
};

Colour shade_of(const Backdrop& b, manifests::Rng& rng) {
  return blend(b.blade_dark, b.blade_light, static_cast<float>(rng.uniform())) *
         static_cast<float>(rng.uniform(0.6, 1.0));
}

Colour bark(manifests::Rng& rng) {
  return blend(rgb(44, 36, 28), rgb(132, 114, 92), static_cast<float>(rng.uniform()));
}

cv::Point within(const cv::Rect& area, manifests::Rng& rng) {
  return {area.x + rng.below(std::max(1, area.width)), area.y + rng.below(std::max(1, area.height))};
}

void leafy_branch(Layer& layer, const cv::Rect& animal, const Backdrop& backdrop, manifests::Rng& rng) {
  const cv::Point middle = within(animal, rng);
  const double angle = rng.uniform(-0.9, 0.9), reach = animal.width * rng.uniform(0.5, 1.0);
  const cv::Point2d along(std::cos(angle), std::sin(angle));
  const int thick = std::max(2, animal.width / 50);
  const cv::Point from = middle - cv::Point(along * reach), to = middle + cv::Point(along * reach);
  layer.line(from, to, bark(rng), thick);
  const int leaves = 10 + rng.below(25);
  for (int i = 0; i < leaves; ++i) {
    const cv::Point2d at = cv::Point2d(middle) + along * reach * rng.uniform(-1.0, 1.0);
    const double length = animal.width * rng.uniform(0.03, 0.08);
    layer.ellipse(cv::Point(at) + cv::Point(rng.below(2 * thick + 8) - thick - 4, rng.below(16) - 8),
                  cv::Size(static_cast<int>(length) + 1, static_cast<int>(0.4 * length) + 1),
                  rng.uniform(0.0, 180.0), shade_of(backdrop, rng));
  }
}

void upright(Layer& layer, const cv::Rect& animal, manifests::Rng& rng) {
  const double x = animal.x + animal.width * rng.uniform(0.05, 0.95);
  const double width = animal.width * rng.uniform(0.04, 0.16), lean = animal.height * rng.normal(0.0, 0.1);
  const Colour colour = bark(rng);
  constexpr int kStrips = 4;
  for (int strip = 0; strip < kStrips; ++strip) {
    const int left = static_cast<int>(x + width * strip / kStrips);
    const int right = static_cast<int>(x + width * (strip + 1) / kStrips) + 1;
    layer.polygon({{left, layer.cover.rows + 2},
                   {right, layer.cover.rows + 2},
                   {right + static_cast<int>(lean), -2},
                   {left + static_cast<int>(lean), -2}},
                  colour * (0.7F + 0.15F * static_cast<float>(strip)));
  }
}

// Draws a tuft of grass that is dense and high in its middle and thin at its edges.
void tall_grass(Layer& layer, const cv::Rect& animal, const Backdrop& backdrop, manifests::Rng& rng) {
  const int blades = 60 + rng.below(120);
  const double height = animal.height * rng.uniform(0.2, 0.5);
  const double middle = animal.x + animal.width * rng.uniform(0.0, 1.0),
               spread = animal.width * rng.uniform(0.1, 0.25);
  const int base = animal.y + animal.height + animal.height / 12;
  for (int i = 0; i < blades; ++i) {
    const double away = std::clamp(rng.normal(), -2.2, 2.2);
    const cv::Point foot(static_cast<int>(middle + spread * away),
                         base + static_cast<int>(0.06 * animal.height * rng.normal()));
    const double length = height * rng.uniform(0.4, 1.2) * (1.1 - 0.3 * std::abs(away));
    const double lean = 0.12 * away + rng.normal(0.0, 0.18);
    const cv::Point tip = foot + cv::Point(static_cast<int>(length * lean), static_cast<int>(-length));
    layer.line(foot, tip, shade_of(backdrop, rng), 1 + rng.below(2));
  }
}

// Draws the upper half of a boulder in front of the animal, with an uneven outline and a lit top.
void stone(Layer& layer, const cv::Rect& animal, manifests::Rng& rng) {
  const Colour colour = blend(rgb(84, 80, 74), rgb(168, 162, 152), static_cast<float>(rng.uniform()));
  const double width = animal.width * rng.uniform(0.12, 0.3),
               height = animal.height * rng.uniform(0.15, 0.35);
  const cv::Point2d foot(animal.x + animal.width * rng.uniform(), animal.y + 1.04 * animal.height);
  std::vector<cv::Point2d> outline;
  constexpr int kCorners = 13;
  for (int corner = 0; corner < kCorners; ++corner) {
    const double angle = CV_PI * corner / (kCorners - 1), bump = rng.uniform(0.86, 1.08);
    outline.emplace_back(width * bump * std::cos(angle), -height * bump * std::pow(std::sin(angle), 0.7));
  }
  for (const double part : {1.0, 0.85, 0.65}) {  // nested outlines, the inner ones lighter and higher
    std::vector<cv::Point> corners;
    for (const cv::Point2d& p : outline) {
      corners.emplace_back(static_cast<int>(foot.x + part * p.x),
                           static_cast<int>(foot.y + part * p.y - 0.9 * (1.0 - part) * height));
    }
    layer.polygon(corners, colour * static_cast<float>(1.35 - 0.65 * part));
  }
}

void bars(Layer& layer, const cv::Rect& animal, manifests::Rng& rng) {
  const Colour colour = blend(rgb(60, 60, 62), rgb(180, 180, 178), static_cast<float>(rng.uniform()));
  const int thick = std::max(1, animal.width / 60);
  const double gap = animal.width * rng.uniform(0.12, 0.3);
  const bool level = rng.chance(0.3);
  for (double at = gap * rng.uniform(); at < std::max(layer.cover.cols, layer.cover.rows); at += gap) {
    const int where = static_cast<int>(at);
    if (level)
      layer.line({0, where}, {layer.cover.cols, where}, colour, thick);
    else
      layer.line({where, 0}, {where, layer.cover.rows}, colour, thick);
  }
}

void near_blur(Layer& layer, const cv::Rect& animal, const Backdrop& backdrop, manifests::Rng& rng) {
  const int blobs = 2 + rng.below(4);
  for (int i = 0; i < blobs; ++i) {
    const int reach = static_cast<int>(animal.width * rng.uniform(0.06, 0.18)) + 2;
    layer.ellipse(within(animal, rng), cv::Size(reach, std::max(2, reach / 2)), rng.uniform(0.0, 180.0),
                  shade_of(backdrop, rng));
  }
  layer.soften(0.02 * animal.width + 1.0);
}

}  // namespace

void paint_occluder(cv::Mat& picture, cv::Mat1b& cover, const cv::Rect& animal_px, const Backdrop& backdrop,
                    manifests::Rng& rng) {
  Layer layer(picture.size());
  const bool indoors = backdrop.place == Place::room || backdrop.place == Place::studio;
  switch (indoors ? 1 + 3 * rng.below(2) : rng.below(6)) {
    case 0:
      leafy_branch(layer, animal_px, backdrop, rng);
      break;
    case 1:
      upright(layer, animal_px, rng);
      break;
    case 2:
      tall_grass(layer, animal_px, backdrop, rng);
      break;
    case 3:
      stone(layer, animal_px, rng);
      break;
    case 4:
      bars(layer, animal_px, rng);
      break;
    default:
      near_blur(layer, animal_px, backdrop, rng);
      break;
  }
  for (int row = 0; row < picture.rows; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    const auto* over = layer.colour.ptr<cv::Vec3b>(row);
    for (int column = 0; column < picture.cols; ++column) {
      const int alpha = layer.cover(row, column);
      if (alpha == 0) continue;
      for (int channel = 0; channel < 3; ++channel) {
        out[column][channel] = static_cast<std::uint8_t>(
            (out[column][channel] * (255 - alpha) + over[column][channel] * alpha) / 255);
      }
      cover(row, column) = std::max(cover(row, column), static_cast<std::uint8_t>(alpha >= 128 ? 255 : 0));
    }
  }
}

void paint_grass_at_feet(cv::Mat& picture, const Backdrop& backdrop, const PictureCamera& camera,
                         const Ground& ground, std::span<const Eigen::Vector3f> vertices,
                         manifests::Rng& rng) {
  std::vector<Eigen::Vector3f> low;
  for (const Eigen::Vector3f& vertex : vertices) {
    if (ground.up.dot(vertex) - ground.level < 0.06F) low.push_back(vertex);
  }
  if (low.empty()) return;
  const int blades = static_cast<int>(7.0F * backdrop.blades);
  for (int i = 0; i < blades; ++i) {
    const Eigen::Vector3f& vertex = low[static_cast<std::size_t>(rng.below(static_cast<int>(low.size())))];
    const double unit_px = camera.focal_px / vertex.z();
    const Eigen::Vector2d foot = camera.project(vertex);
    const Colour colour = blend(backdrop.blade_dark, backdrop.blade_light, static_cast<float>(rng.uniform()));
    paint_blade(picture, cv::Point2d(foot.x() + 0.05 * unit_px * rng.normal(), foot.y() + 0.03 * unit_px),
                backdrop.blade_length * unit_px * rng.uniform(0.5, 1.3), colour, rng);
  }
}

}  // namespace q3d::pipeline::world
