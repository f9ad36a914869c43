#include "pipeline/world/lens.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

namespace q3d::pipeline::world {
namespace {

void smear(cv::Mat& picture, manifests::Rng& rng) {
  const int length = 3 + 2 * rng.below(4);
  const double angle = rng.normal(0.0, 0.5);
  cv::Mat1f kernel(length, length, 0.0F);
  for (int i = 0; i < length; ++i) {
    const double along = i - length / 2;
    const int row =
        std::clamp(static_cast<int>(std::lround(length / 2 + along * std::sin(angle))), 0, length - 1);
    const int column =
        std::clamp(static_cast<int>(std::lround(length / 2 + along * std::cos(angle))), 0, length - 1);
    kernel(row, column) += 1.0F / static_cast<float>(length);
  }
  cv::filter2D(picture, picture, -1, kernel);
}

// Applies contrast, exposure and white balance, with one curve for each channel.
void grade(cv::Mat& picture, const LensHabits& habits, manifests::Rng& rng) {
  const double contrast = habits.contrast * std::exp(rng.normal(0.0, 0.08));
  const double brightness = rng.normal(0.0, 8.0);
  const double warm = rng.normal(0.0, habits.warmth_spread),
               green = rng.normal(0.0, 0.3 * habits.warmth_spread);
  const double gains[3] = {1.0 - warm, 1.0 + green, 1.0 + warm};
  cv::Mat curve(1, 256, CV_8UC3);
  for (int level = 0; level < 256; ++level) {
    for (int channel = 0; channel < 3; ++channel) {
      const double value = gains[channel] * (128.0 + contrast * (level - 128.0) + brightness);
      curve.at<cv::Vec3b>(0, level)[channel] = cv::saturate_cast<std::uint8_t>(value);
    }
  }
  cv::LUT(picture, curve, picture);

  const int keep = static_cast<int>(256.0 * habits.saturation * std::exp(rng.normal(0.0, 0.1)));
  for (int row = 0; row < picture.rows; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    for (int column = 0; column < picture.cols; ++column) {
      cv::Vec3b& p = out[column];
      const int grey = (p[0] * 29 + p[1] * 150 + p[2] * 77) >> 8;
      for (int channel = 0; channel < 3; ++channel) {
        p[channel] = cv::saturate_cast<std::uint8_t>(grey + ((p[channel] - grey) * keep) / 256);
      }
    }
  }
}

// Makes a camera trap's night picture, with no colour, a bright middle and dark corners.
void infrared(cv::Mat& picture, manifests::Rng& rng) {
  const double reach = rng.uniform(0.6, 1.1);
  const cv::Point2d middle(picture.cols * rng.uniform(0.4, 0.6), picture.rows * rng.uniform(0.4, 0.7));
  for (int row = 0; row < picture.rows; ++row) {
    auto* out = picture.ptr<cv::Vec3b>(row);
    for (int column = 0; column < picture.cols; ++column) {
      cv::Vec3b& p = out[column];
      const double grey = 0.3 * p[0] + 0.3 * p[1] + 0.4 * p[2];
      const double away = std::hypot(column - middle.x, row - middle.y) / (reach * picture.cols);
      const double lit = grey * std::clamp(1.15 - away * away * 2.2, 0.12, 1.15);
      p = cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(lit));
    }
  }
}

cv::Rect stamp(cv::Mat& picture, manifests::Rng& rng) {
  const int height = std::max(12, picture.rows / 14);
  const cv::Rect bar(0, rng.chance(0.7) ? picture.rows - height : 0, picture.cols, height);
  cv::rectangle(picture, bar, cv::Scalar(12, 12, 12), cv::FILLED);
  char text[96];
  std::snprintf(text, sizeof text, "CAM%02d  20%02d-%02d-%02d  %02d:%02d:%02d  %02dC", 1 + rng.below(40),
                10 + rng.below(14), 1 + rng.below(12), 1 + rng.below(28), rng.below(24), rng.below(60),
                rng.below(60), rng.below(35));
  cv::putText(picture, text, cv::Point(6, bar.br().y - height / 3), cv::FONT_HERSHEY_SIMPLEX, height / 36.0,
              cv::Scalar(235, 235, 235), 1, cv::LINE_AA);
  return bar;
}

void add_noise(cv::Mat& picture, double deviation, manifests::Rng& rng) {
  cv::Mat grain(picture.size(), CV_16SC3);
  cv::RNG generator(rng.next());
  generator.fill(grain, cv::RNG::NORMAL, 0.0, deviation);
  cv::add(picture, grain, picture, cv::noArray(), CV_8U);
}

}  // namespace

cv::Rect expose(cv::Mat& picture, const LensHabits& habits, manifests::Rng& rng) {
  const double sigma = rng.uniform(habits.blur_low, habits.blur_high);
  if (sigma > 0.3) cv::GaussianBlur(picture, picture, {}, sigma);
  if (rng.chance(habits.motion)) smear(picture, rng);
  grade(picture, habits, rng);
  if (rng.chance(habits.grey)) infrared(picture, rng);
  add_noise(picture, rng.uniform(habits.noise_low, habits.noise_high), rng);
  return rng.chance(habits.stamped) ? stamp(picture, rng) : cv::Rect();
}

std::vector<std::uint8_t> encode_jpeg(const cv::Mat& picture, const LensHabits& habits, manifests::Rng& rng) {
  const int quality = habits.quality_low + rng.below(habits.quality_high - habits.quality_low + 1);
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".jpg", picture, bytes, {cv::IMWRITE_JPEG_QUALITY, quality})) {
    throw std::runtime_error("world: cannot encode a JPEG of " + std::to_string(picture.cols) + " x " +
                             std::to_string(picture.rows) + " px");
  }
  return bytes;
}

}  // namespace q3d::pipeline::world
