#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include "pipeline/dataset/explain.h"

namespace q3d::pipeline::dataset {
namespace {

using nlohmann::ordered_json;

std::string line(const char* label, const std::string& text) {
  return fmt::format("  {:<11} {}\n", label, text);
}

std::string numbers(const ordered_json& list, const char* format = "{:.1f}") {
  std::string text;
  for (const ordered_json& value : list) {
    text += (text.empty() ? "" : ", ") + fmt::format(fmt::runtime(format), value.get<double>());
  }
  return text;
}

std::string tell_source(const ordered_json& source) {
  const auto text = [&](const char* key) { return source.at(key).get<std::string>(); };
  std::string told = line("dataset", text("dataset") + ", split " + text("split") +
                                         (text("source").empty() ? "" : ", source " + text("source")));
  told += line("animal", (text("species").empty() ? "species unknown" : text("species")) + ", family " +
                             text("family"));
  told += line("picture", text("picture").empty() ? "unknown" : text("picture"));
  if (!text("image_sha256").empty()) told += line("", "SHA-256 " + text("image_sha256"));
  return told;
}

std::string tell_crop(const ordered_json& crop) {
  return line("box", fmt::format("x, y, width, height = {} px", numbers(crop.at("box_xywh_px")))) +
         line("crop",
              fmt::format("square of {:.1f} px around ({}), seen at {} px", crop.at("side_px").get<double>(),
                          numbers(crop.at("center_px"), "{:.0f}"), crop.at("patch_side_px").get<int>()));
}

std::string error_text(const ordered_json& error, double side_px) {
  if (error.is_null()) return fmt::format("{:>8} {:>9}", "-", "");
  return fmt::format("{:>8.4f} {:>9}", error.get<double>(),
                     fmt::format("({:.1f} px)", error.get<double>() * side_px));
}

// Lists the keypoints, the worst first. Unlabelled ones are only counted.
std::string tell_keypoints(const ordered_json& story) {
  const double side_px = story.at("crop").at("side_px").get<double>();
  std::vector<const ordered_json*> visible;
  for (const ordered_json& point : story.at("keypoints")) {
    if (point.at("weight").get<double>() > 0) visible.push_back(&point);
  }
  const auto size = [](const ordered_json* point) {
    const ordered_json& before = point->at("error_before");
    const ordered_json& error = before.is_null() ? point->at("error_after") : before;
    return error.is_null() ? 0.0 : error.get<double>();
  };
  std::stable_sort(visible.begin(), visible.end(), [&](auto* a, auto* b) { return size(a) > size(b); });
  std::string told = fmt::format(
      "\n  {} of {} keypoints are visible; their errors, worst first ((|dx| + |dy|) / 2, "
      "crop side = 1):\n  {:<20} {:>4} {:>6} {:>18} {:>18}\n",
      visible.size(), story.at("keypoints").size(), "keypoint", "v", "weight", "predicted",
      "after adaptation");
  for (const ordered_json* point : visible) {
    told += fmt::format("  {:<20} {:>4} {:>6} {} {}\n", point->at("name").get<std::string>(),
                        point->at("v").dump(), point->at("weight").dump(),
                        error_text(point->at("error_before"), side_px),
                        error_text(point->at("error_after"), side_px));
  }
  return told;
}

// Draws the curve in one line. The heights range from its least to its greatest value.
std::string sparkline(const std::vector<double>& curve) {
  constexpr std::array<std::string_view, 8> kBars{"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  const auto [least, greatest] = std::minmax_element(curve.begin(), curve.end());
  const double range = *greatest - *least;
  std::string text;
  for (const double value : curve) {
    const double height = range > 0 ? (value - *least) / range : 0.0;
    text += kBars[static_cast<std::size_t>(height * (kBars.size() - 1) + 0.5)];
  }
  return text;
}

std::string tell_curve(const ordered_json& curve) {
  constexpr std::size_t kPerLine = 8;
  std::vector<double> finite;
  std::string told;
  for (std::size_t i = 0; i < curve.size(); ++i) {
    if (!curve[i].is_null()) finite.push_back(curve[i].get<double>());
    told += i % kPerLine == 0 ? "\n  " : "  ";
    told += fmt::format("{:>3}: {}", i,
                        curve[i].is_null() ? "   nan" : fmt::format("{:.4f}", curve[i].get<double>()));
  }
  if (finite.empty()) return told + '\n';
  return fmt::format("\n  L_proj by iteration of adaptation\n  {}{}\n", sparkline(finite), told);
}

}  // namespace

std::string tell(const ordered_json& story) {
  const ordered_json& verdict = story.at("verdict");
  const std::string reason = verdict.at("reason").get<std::string>();
  std::string told = story.at("id").get<std::string>() + '\n';
  told += line("verdict", verdict.at("verdict").get<std::string>() +
                              (reason.empty() || reason == "none" ? "" : ": " + reason));
  told += line("why", story.at("why").get<std::string>());
  const std::string detail = verdict.at("detail").get<std::string>();
  const bool is_told = story.at("why").get<std::string>().find(detail) != std::string::npos;
  if (!is_told) told += line("detail", detail);
  told += tell_source(story.at("source"));
  if (story.contains("crop")) told += tell_crop(story.at("crop"));
  if (story.contains("label")) {
    const ordered_json& label = story.at("label");
    told += line("label",
                 fmt::format("row {} of {}. {}", label.at("row").dump(), label.at("shard").get<std::string>(),
                             label.at("meaning").get<std::string>()));
  }
  if (story.contains("keypoints")) told += tell_keypoints(story);
  if (story.contains("curve")) told += tell_curve(story.at("curve"));
  if (story.contains("missing")) {
    for (const ordered_json& what : story.at("missing"))
      told += "\n  not found: " + what.get<std::string>() + '\n';
  }
  return told;
}

}  // namespace q3d::pipeline::dataset
