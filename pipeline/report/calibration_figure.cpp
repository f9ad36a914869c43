#include "pipeline/report/calibration_figure.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

namespace q3d::pipeline::report {
namespace {

using filters::YieldPoint;

constexpr int kWidth = 760;
constexpr int kPanelHeight = 380;
constexpr double kLeft = 60, kRight = kWidth - 60, kTop = 60, kBottom = kPanelHeight - 60;
constexpr const char* kYieldColour = "#1f5fa8";
constexpr const char* kAucColour = "#c25a12";
constexpr std::size_t kTableSteps = 10;

// The axis of tau ends where nearly all of the pool has been let in; a few errors lie far beyond.
constexpr double kShownYield = 0.95;
constexpr double kBeyondTauHigh = 1.25;

double last_tau(const filters::CalibratedPool& pool) {
  double last = kBeyondTauHigh * pool.at_tau_high.tau;
  for (const YieldPoint& point : pool.curve) {
    if (point.yield <= kShownYield) last = std::max(last, point.tau);
  }
  return last;
}

// 1, 2 or 5 times a power of ten, so that five steps or so fill the range.
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

  std::string draw() {
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

  template <typename... Values>
  void add(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(svg_), format, std::forward<Values>(values)...);
  }

  void text(double x, double y, const char* anchor, const char* colour, const std::string& words) {
    add("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\">{}</text>\n", x, y, anchor, colour,
        words);
  }

  void line(double x1, double y1, double x2, double y2, const char* style) {
    add("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x1, y1, x2, y2, style);
  }

  void title() {
    text(kLeft, top_ + 24, "start", "#222",
         fmt::format("{}: {} predictions", pool_.dataset.empty() ? "all datasets" : pool_.dataset,
                     pool_.judged));
  }

  void axes() {
    for (int percent = 0; percent <= 100; percent += 20) {
      line(kLeft, y_of(percent), kRight, y_of(percent), "stroke=\"#ddd\"");
      text(kLeft - 8, y_of(percent) + 4, "end", kYieldColour, std::to_string(percent));
      text(kRight + 8, y_of(percent) + 4, "start", kAucColour, std::to_string(percent));
    }
    const double step = tick_step(last_tau_);
    for (int i = 0; i * step <= last_tau_; ++i) {
      line(x_of(i * step), y_of(0), x_of(i * step), y_of(0) + 5, "stroke=\"#888\"");
      text(x_of(i * step), y_of(0) + 20, "middle", "#222", fmt::format("{:g}", i * step));
    }
    text((kLeft + kRight) / 2, y_of(0) + 42, "middle", "#222", "threshold on L_proj (crop side = 1)");
    text(kLeft, y_of(100) - 10, "start", kYieldColour, "yield, % of the predictions below the threshold");
    text(kRight, y_of(100) - 10, "end", kAucColour, "their mean AUC, %, by the whole crop");
  }

  template <typename Percent>
  void curve(const char* colour, Percent percent) {
    add("<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"2\" points=\"", colour);
    for (const YieldPoint& point : pool_.curve) {
      if (point.tau <= last_tau_) add("{:.1f},{:.1f} ", x_of(point.tau), y_of(percent(point)));
    }
    add("\"/>\n");
  }

  // `row` keeps the two labels apart where the thresholds lie close together.
  void chosen(const char* name, const YieldPoint& point, int row) {
    const double x = x_of(point.tau);
    line(x, y_of(100), x, y_of(0), "stroke=\"#222\" stroke-dasharray=\"5 4\"");
    dot(x, y_of(100.0 * point.yield), kYieldColour);
    if (std::isfinite(point.auc)) dot(x, y_of(point.auc), kAucColour);
    text(x + 6, y_of(14.0 - 7.0 * row), "start", "#222",
         fmt::format("{} {:.4g}: yield {:.1f} %", name, point.tau, 100.0 * point.yield));
  }

  void dot(double x, double y, const char* colour) {
    add("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", x, y, colour);
  }

  const filters::CalibratedPool& pool_;
  double top_;
  double last_tau_;
  std::string svg_;
};

std::string table_line(const YieldPoint& point, const std::string& remark) {
  const std::string auc = std::isfinite(point.auc) ? fmt::format("{:.2f}", point.auc) : "-";
  return fmt::format("  {:>10.4g}  {:>7.1f}  {:>7}{}\n", point.tau, 100.0 * point.yield, auc,
                     remark.empty() ? "" : "  <- " + remark);
}

}  // namespace

std::string calibration_figure(std::span<const filters::CalibratedPool> pools) {
  const auto height = kPanelHeight * static_cast<int>(pools.size());
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n",
      kWidth, height);
  double top = 0.0;
  for (const filters::CalibratedPool& pool : pools) {
    svg += Panel(pool, top).draw();
    top += kPanelHeight;
  }
  return svg + "</svg>\n";
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
