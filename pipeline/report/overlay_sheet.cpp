#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <span>
#include <stdexcept>
#include <vector>

#include "pipeline/report/lettering.h"
#include "pipeline/report/overlay_painter.h"

namespace q3d::pipeline::report {
namespace {

constexpr int kMarginPx = 12;

struct LegendEntry {
  cv::Scalar colour;
  const char* text;
};

std::vector<LegendEntry> entries_of(std::span<const Panel> panels) {
  const auto has = [&](Panel panel) { return std::ranges::find(panels, panel) != panels.end(); };
  std::vector<LegendEntry> entries;
  if (has(Panel::prediction) || has(Panel::side)) {
    entries.push_back({colours::kBlue, "mesh: the network's prediction"});
  }
  if (has(Panel::label) || has(Panel::side)) {
    entries.push_back({colours::kOrange, "mesh: label, or adapted and dropped"});
  }
  if (has(Panel::keypoints)) {
    entries.insert(entries.end(), {{colours::kBlue, "bones and keypoints: left of the animal"},
                                   {colours::kOrange, "right of the animal"},
                                   {colours::kWhite, "middle"},
                                   {colours::kYellow, "cross: keypoint of the body; line: its error"}});
  }
  return entries;
}

}  // namespace

cv::Mat overlay_legend(std::span<const Panel> panels, int width_px) {
  const std::vector<LegendEntry> entries = entries_of(panels);
  if (entries.empty()) return cv::Mat(0, width_px, CV_8UC3);
  constexpr int kSwatch = 12;
  const int step = line_height_px(TextSize::small) + 4;
  std::vector<cv::Point> places;
  cv::Point at(0, 0);
  for (const LegendEntry& entry : entries) {
    const int width = kSwatch + 6 + text_width_px(entry.text, TextSize::small) + 18;
    if (at.x > 0 && at.x + width > width_px) at = {0, at.y + step};
    places.push_back(at);
    at.x += width;
  }
  cv::Mat strip(at.y + step, width_px, CV_8UC3, colours::kPaper);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const cv::Rect swatch(places[i].x, places[i].y + 1, kSwatch, kSwatch);
    cv::rectangle(strip, swatch, entries[i].colour, cv::FILLED);
    cv::rectangle(strip, swatch, colours::kGrey);
    write(strip, entries[i].text, {places[i].x + kSwatch + 6, places[i].y}, TextSize::small);
  }
  return strip;
}

cv::Mat overlay_sheet(const std::vector<cv::Mat>& pictures, std::span<const Panel> panels, int columns) {
  if (pictures.empty()) throw std::invalid_argument("overlay_sheet: there is no picture");
  const int across = std::clamp(columns, 1, static_cast<int>(pictures.size()));
  int cell_width = 0;
  for (const cv::Mat& picture : pictures) cell_width = std::max(cell_width, picture.cols);
  std::vector<int> heights;  // of the lines
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (i % static_cast<std::size_t>(across) == 0) heights.push_back(0);
    heights.back() = std::max(heights.back(), pictures[i].rows);
  }
  const int width = across * cell_width + (across + 1) * kMarginPx;
  const cv::Mat legend = overlay_legend(panels, width - 2 * kMarginPx);
  int height = kMarginPx + (legend.empty() ? 0 : legend.rows + kMarginPx);
  for (const int line : heights) height += line + kMarginPx;
  cv::Mat sheet(height, width, CV_8UC3, colours::kPaper);
  int y = kMarginPx;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const int column = static_cast<int>(i) % across;
    const int line = heights[i / static_cast<std::size_t>(across)];
    const int x = kMarginPx + column * (cell_width + kMarginPx);
    // A picture is aligned to the bottom of its line, so that pictures with captions of different heights are
    // level.
    pictures[i].copyTo(sheet(cv::Rect(x, y + line - pictures[i].rows, pictures[i].cols, pictures[i].rows)));
    if (column == across - 1 || i + 1 == pictures.size()) y += line + kMarginPx;
  }
  if (!legend.empty()) legend.copyTo(sheet(cv::Rect(kMarginPx, y, legend.cols, legend.rows)));
  return sheet;
}

}  // namespace q3d::pipeline::report
