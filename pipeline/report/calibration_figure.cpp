#include "pipeline/report/calibration_figure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/figure/svg.h"

namespace q3d::pipeline::report {
namespace {

using figure::Anchor;
using figure::Place;
using figure::Svg;
using filters::YieldPoint;

constexpr double kWidth = 760;
constexpr double kPanelHeight = 380;
constexpr double kLeft = 60, kRight = kWidth - 60, kTop = 60, kBottom = kPanelHeight - 60;
constexpr const char* kYieldColour = "#1f5fa8";
constexpr const char* kAucColour = "#c25a12";
constexpr const char* kInk = "#222";
constexpr double kDotPx = 4;
constexpr std::size_t kTableSteps = 10;

// The axis of tau ends at this yield, because a few errors lie far beyond.
constexpr double kShownYield = 0.95;
constexpr double kBeyondTauHigh = 1.25;

double last_tau(const filters::CalibratedPool& pool) {
  double last = kBeyondTauHigh * pool.at_tau_high.tau;
  for (const YieldPoint& point : pool.curve) {
    if (point.yield <= kShownYield) last = std::max(last, point.tau);
  }
  return last;
}

// Returns 1, 2 or 5 times a power of ten, so that about five steps fill the range.
double tick_step(double range) {
  const double raw = range / 5.0;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw) return factor * power;
  }
  return 10.0 * power;
}

class Panel {
 public:
  Panel(const filters::CalibratedPool& pool, double top)
      : pool_(pool), top_(top), last_tau_(last_tau(pool)) {}

  Svg draw() {
    title();
    axes();
    curve(kYieldColour, [](const YieldPoint& point) { return 100.0 * point.yield; });
    curve(kAucColour, [](const YieldPoint& point) { return point.auc; });
    chosen("tau_low", pool_.at_tau_low, 0);
    chosen("tau_high", pool_.at_tau_high, 1);
    return svg_;
  }

 private:
  double x_of(double tau) const { return kLeft + (kRight - kLeft) * tau / last_tau_; }
  double y_of(double percent) const { return top_ + kBottom - (kBottom - kTop) * percent / 100.0; }

  void title() {
    svg_.text({kLeft, top_ + 24}, Anchor::start, kInk,
              fmt::format("{}: {} predictions", pool_.dataset.empty() ? "all datasets" : pool_.dataset,
                          pool_.judged));
  }

  void axes() {
    for (int percent = 0; percent <= 100; percent += 20) {
      const double y = y_of(percent);
      svg_.line({kLeft, y}, {kRight, y}, "stroke=\"#ddd\"");
      svg_.text({kLeft - 8, y + 4}, Anchor::end, kYieldColour, std::to_string(percent));
      svg_.text({kRight + 8, y + 4}, Anchor::start, kAucColour, std::to_string(percent));
    }
    const double step = tick_step(last_tau_);
    for (int i = 0; i * step <= last_tau_; ++i) {
      const double x = x_of(i * step);
      svg_.line({x, y_of(0)}, {x, y_of(0) + 5}, "stroke=\"#888\"");
      svg_.text({x, y_of(0) + 20}, Anchor::middle, kInk, fmt::format("{:g}", i * step));
    }
    svg_.text({(kLeft + kRight) / 2, y_of(0) + 42}, Anchor::middle, kInk,
              "threshold on L_proj (crop side = 1)");
    svg_.text({kLeft, y_of(100) - 10}, Anchor::start, kYieldColour,
              "yield, % of the predictions below the threshold");
    svg_.text({kRight, y_of(100) - 10}, Anchor::end, kAucColour, "their mean AUC, %, by the whole crop");
  }

  template <typename Percent>
  void curve(const char* colour, Percent percent) {
    std::vector<Place> places;
    for (const YieldPoint& point : pool_.curve) {
      if (point.tau <= last_tau_) places.push_back({x_of(point.tau), y_of(percent(point))});
    }
    svg_.polyline(places, colour);
  }

  // Draws a chosen point. `row` separates the two labels if the thresholds lie close together.
  void chosen(const char* name, const YieldPoint& point, int row) {
    const double x = x_of(point.tau);
    svg_.line({x, y_of(100)}, {x, y_of(0)}, "stroke=\"#222\" stroke-dasharray=\"5 4\"");
    svg_.dot({x, y_of(100.0 * point.yield)}, kDotPx, kYieldColour);
    if (std::isfinite(point.auc)) svg_.dot({x, y_of(point.auc)}, kDotPx, kAucColour);
    svg_.text({x + 6, y_of(14.0 - 7.0 * row)}, Anchor::start, kInk,
              fmt::format("{} {:.4g}: yield {:.1f} %", name, point.tau, 100.0 * point.yield));
  }

  const filters::CalibratedPool& pool_;
  double top_;
  double last_tau_;
  Svg svg_;
};

std::string table_line(const YieldPoint& point, const std::string& remark) {
  const std::string auc = std::isfinite(point.auc) ? fmt::format("{:.2f}", point.auc) : "-";
  return fmt::format("  {:>10.4g}  {:>7.1f}  {:>7}{}\n", point.tau, 100.0 * point.yield, auc,
                     remark.empty() ? "" : "  <- " + remark);
}

}  // namespace

std::string calibration_figure(std::span<const filters::CalibratedPool> pools) {
  Svg svg;
  double top = 0.0;
  for (const filters::CalibratedPool& pool : pools) {
    svg.append(Panel(pool, top).draw());
    top += kPanelHeight;
  }
  return svg.document(kWidth, top);
}

std::string calibration_table(const filters::CalibratedPool& pool) {
  std::vector<std::pair<YieldPoint, std::string>> rows{{pool.at_tau_low, "tau_low"},
                                                       {pool.at_tau_high, "tau_high"}};
  std::size_t step = 1;
  for (const YieldPoint& point : pool.curve) {
    if (point.yield * kTableSteps < static_cast<double>(step) - 1e-9) continue;
    rows.push_back({point, ""});
    step = static_cast<std::size_t>(point.yield * kTableSteps + 1e-9) + 1;
  }
  std::stable_sort(rows.begin(), rows.end(),
                   [](const auto& a, const auto& b) { return a.first.tau < b.first.tau; });
  std::string text = fmt::format("  {:>10}  {:>7}  {:>7}\n", "threshold", "yield %", "AUC %");
  for (const auto& [point, remark] : rows) text += table_line(point, remark);
  return text;
}

}  // namespace q3d::pipeline::report
