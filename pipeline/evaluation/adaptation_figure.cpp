#include "pipeline/evaluation/adaptation_figure.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pipeline/figure/svg.h"

namespace q3d::pipeline::evaluation {
namespace {

using figure::Anchor;
using figure::Place;
using figure::Svg;

constexpr double kPanelWidth = 460, kPanelHeight = 320;
constexpr double kLeft = 60, kRight = 20, kTop = 40, kBottom = 56;  // margins of a panel
constexpr double kLegendHeight = 30;
constexpr int kTicks = 5;
// Okabe and Ito's colours, which colour-blind people can tell apart.
constexpr std::array<const char*, 7> kColours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                              "#56b4e9", "#e69f00", "#000000"};

constexpr const char* kInk = "#222";

struct Line {
  std::string dataset;
  std::vector<Place> points;  // in the units of the axes, by ascending x
};

struct Range {
  double from;
  double to;
};

// The x axis of a row of panels.
struct Axis {
  const char* title;
  bool (*is_on)(const Setting&);
  double (*value)(const Setting&);
};

constexpr Axis kByIterations{"iterations of adaptation (the iterate itself)",
                             [](const Setting& setting) { return setting.name.starts_with("iterate "); },
                             [](const Setting& setting) { return static_cast<double>(setting.iterations); }};
constexpr Axis kByKeypoints{"% of the visible keypoints that adaptation is given",
                            [](const Setting& setting) { return setting.name.starts_with("TTA "); },
                            [](const Setting& setting) { return 100.0 * setting.visible_share; }};

std::vector<Line> lines_of(const Tables& tables, const Axis& axis, Metric metric) {
  std::vector<Line> lines;
  for (const TableRow& row : tables.datasets) {
    const std::optional<double> mean = row.metrics[index_of(metric)].mean;
    if (!axis.is_on(*row.setting) || !mean) continue;
    auto line = std::find_if(lines.begin(), lines.end(),
                             [&](const Line& known) { return known.dataset == row.dataset; });
    if (line == lines.end()) line = lines.insert(line, {row.dataset, {}});
    line->points.push_back({axis.value(*row.setting), *mean});
  }
  std::erase_if(lines, [](const Line& line) { return line.points.size() < 2; });
  for (Line& line : lines) {
    std::sort(line.points.begin(), line.points.end(),
              [](const Place& a, const Place& b) { return a.x < b.x; });
  }
  return lines;
}

Range range_of(const std::vector<Line>& lines, double Place::*coordinate) {
  Range range{INFINITY, -INFINITY};
  for (const Line& line : lines) {
    for (const Place& point : line.points) {
      range.from = std::min(range.from, point.*coordinate);
      range.to = std::max(range.to, point.*coordinate);
    }
  }
  if (range.from == range.to) range.to = range.from + 1.0;
  return range;
}

class Panel {
 public:
  Panel(double left, double top, const std::vector<Line>& lines, const MetricInfo& metric, const Axis& axis)
      : left_(left),
        top_(top),
        lines_(lines),
        metric_(metric),
        axis_(axis),
        x_(range_of(lines, &Place::x)),
        y_(range_of(lines, &Place::y)) {}

  Svg draw() {
    svg_.text({left_ + kLeft, top_ + 22}, Anchor::start, kInk,
              fmt::format("{} ({} is better)", metric_.title, metric_.higher_is_better ? "more" : "less"));
    for (int i = 0; i <= kTicks; ++i) ticks(static_cast<double>(i) / kTicks);
    svg_.text({left_ + (kLeft + kPanelWidth - kRight) / 2, top_ + kPanelHeight - 14}, Anchor::middle, kInk,
              axis_.title);
    for (std::size_t i = 0; i < lines_.size(); ++i) curve(lines_[i], kColours[i % kColours.size()]);
    return svg_;
  }

 private:
  double x_of(double x) const {
    return left_ + kLeft + (kPanelWidth - kLeft - kRight) * (x - x_.from) / (x_.to - x_.from);
  }
  double y_of(double y) const {
    return top_ + kPanelHeight - kBottom -
           (kPanelHeight - kTop - kBottom) * (y - y_.from) / (y_.to - y_.from);
  }

  void ticks(double share) {
    const double x = x_.from + share * (x_.to - x_.from);
    const double y = y_.from + share * (y_.to - y_.from);
    svg_.line({x_of(x_.from), y_of(y)}, {x_of(x_.to), y_of(y)}, "stroke=\"#ddd\"");
    svg_.text({x_of(x_.from) - 8, y_of(y) + 4}, Anchor::end, kInk, fmt::format("{:.1f}", y));
    svg_.text({x_of(x), y_of(y_.from) + 20}, Anchor::middle, kInk,
              fmt::format("{:g}", std::round(10.0 * x) / 10.0));
  }

  void curve(const Line& line, const char* colour) {
    std::vector<Place> places;
    for (const Place& point : line.points) places.push_back({x_of(point.x), y_of(point.y)});
    svg_.polyline(places, colour);
    for (const Place& place : places) svg_.dot(place, 3.5, colour);
  }

  double left_;
  double top_;
  const std::vector<Line>& lines_;
  const MetricInfo& metric_;
  const Axis& axis_;
  Range x_;
  Range y_;
  Svg svg_;
};

Svg legend(const std::vector<Line>& lines) {
  Svg svg;
  double x = kLeft;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    svg.dot({x, 16}, 5, kColours[i % kColours.size()]);
    svg.text({x + 10, 20}, Anchor::start, kInk, lines[i].dataset);
    x += 30.0 + 8.0 * static_cast<double>(lines[i].dataset.size());
  }
  return svg;
}

}  // namespace

std::string adaptation_figure(const Tables& tables) {
  Svg panels;
  std::vector<Line> named;
  double top = kLegendHeight;
  for (const Axis& axis : {kByIterations, kByKeypoints}) {
    double left = 0.0;
    for (const Metric metric : {Metric::auc, Metric::pa_mpjpe}) {
      const std::vector<Line> lines = lines_of(tables, axis, metric);
      if (lines.empty()) continue;
      panels.append(Panel(left, top, lines, kMetrics[index_of(metric)], axis).draw());
      left += kPanelWidth;
      if (lines.size() > named.size()) named = lines;
    }
    if (left > 0.0) top += kPanelHeight;
  }
  if (panels.is_empty()) return {};
  Svg svg = legend(named);
  svg.append(panels);
  return svg.document(2 * kPanelWidth, top);
}

}  // namespace q3d::pipeline::evaluation
