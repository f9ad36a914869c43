#include "loaders/pictures/perceptual_hash.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace q3d::loaders::pictures {
namespace {

constexpr int kSide = 32;
constexpr int kFrequencies = 11;  // 0..10 along each axis hold the first 65 of the zigzag
constexpr std::size_t kBits = 64;
constexpr double kLeastDeviation = 2.0;

struct Frequency {
  int vertical = 0;
  int horizontal = 0;
};

// JPEG's zigzag (ITU-T T.81, figure 5) without the constant: diagonals of rising frequency, walked
// alternately.
constexpr std::array<Frequency, kBits> zigzag() {
  std::array<Frequency, kBits> order{};
  std::size_t count = 0;
  for (int diagonal = 1; count < kBits; ++diagonal) {
    for (int step = 0; step <= diagonal && count < kBits; ++step) {
      const int vertical = diagonal % 2 == 1 ? step : diagonal - step;
      order[count++] = {vertical, diagonal - vertical};
    }
  }
  return order;
}
constexpr std::array<Frequency, kBits> kOrder = zigzag();

using Coefficients = std::array<double, kBits>;

// (frequency, position): the orthonormal DCT-II of 32 points, up to a factor that all coefficients share.
std::array<std::array<double, kSide>, kFrequencies> cosines() {
  std::array<std::array<double, kSide>, kFrequencies> table{};
  for (int frequency = 0; frequency < kFrequencies; ++frequency) {
    const double scale = frequency == 0 ? 1.0 / std::numbers::sqrt2 : 1.0;
    for (int x = 0; x < kSide; ++x) {
      table[static_cast<std::size_t>(frequency)][static_cast<std::size_t>(x)] =
          scale * std::cos(std::numbers::pi * (2 * x + 1) * frequency / (2.0 * kSide));
    }
  }
  return table;
}

Coefficients transform(const cv::Mat& reduced) {
  static const auto kCosines = cosines();
  std::array<std::array<double, kFrequencies>, kSide> rows{};  // (y, horizontal frequency)
  for (int y = 0; y < kSide; ++y) {
    const auto* pixels = reduced.ptr<std::uint8_t>(y);
    for (std::size_t f = 0; f < kFrequencies; ++f) {
      double sum = 0.0;
      for (std::size_t x = 0; x < kSide; ++x) sum += pixels[x] * kCosines[f][x];
      rows[static_cast<std::size_t>(y)][f] = sum;
    }
  }
  Coefficients coefficients{};
  for (std::size_t i = 0; i < kBits; ++i) {
    const auto& vertical = kCosines[static_cast<std::size_t>(kOrder[i].vertical)];
    const auto horizontal = static_cast<std::size_t>(kOrder[i].horizontal);
    for (std::size_t y = 0; y < kSide; ++y) coefficients[i] += rows[y][horizontal] * vertical[y];
  }
  return coefficients;
}

std::uint64_t bits_of(const Coefficients& coefficients) {
  Coefficients sorted = coefficients;
  std::sort(sorted.begin(), sorted.end());
  const double median = (sorted[kBits / 2 - 1] + sorted[kBits / 2]) / 2.0;
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < kBits; ++i) {
    if (coefficients[i] > median) bits |= std::uint64_t{1} << i;
  }
  return bits;
}

}  // namespace

std::optional<manifests::PictureHash> perceptual_hash(const cv::Mat& rgb) {
  if (rgb.empty() || rgb.type() != CV_8UC3) {
    throw std::invalid_argument("perceptual_hash: expected an 8-bit picture of 3 channels that is not empty");
  }
  cv::Mat luma;
  cv::cvtColor(rgb, luma, cv::COLOR_RGB2GRAY);
  cv::Mat reduced;
  cv::resize(luma, reduced, {kSide, kSide}, 0, 0, cv::INTER_AREA);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(reduced, mean, deviation);
  if (deviation[0] < kLeastDeviation) return std::nullopt;
  Coefficients coefficients = transform(reduced);
  manifests::PictureHash hash;
  hash.upright = bits_of(coefficients);
  for (std::size_t i = 0; i < kBits; ++i) {
    if (kOrder[i].horizontal % 2 == 1) coefficients[i] = -coefficients[i];
  }
  hash.mirrored = bits_of(coefficients);
  return hash;
}

}  // namespace q3d::loaders::pictures
