#include "pipeline/candidates/corrections.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>

#include "loaders/keypoints/topology.h"
#include "loaders/pictures/orientation.h"
#include "loaders/pictures/picture_header.h"
#include "pipeline/candidates/label_checks.h"
#include "pipeline/candidates/list_file.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::candidates {
namespace {

using manifests::Reason;

constexpr std::size_t kCells = 5;

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream rest(line);
  for (std::string cell; std::getline(rest, cell, '\t');) cells.push_back(std::move(cell));
  return cells;
}

template <typename Number>
bool read_number(const std::string& text, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

const std::vector<std::string>& names() {
  static const std::vector<std::string> all = loaders::keypoints::topology("animal3d26").keypoints;
  return all;
}

// Returns false if the cells do not describe a point.
bool read_point(const std::vector<std::string>& cells, CorrectedPoint& point) {
  if (cells.size() != kCells || cells[0].empty()) return false;
  const auto found = std::find(names().begin(), names().end(), cells[1]);
  point.keypoint = static_cast<std::size_t>(found - names().begin());
  return found != names().end() && read_number(cells[2], point.x_px) && read_number(cells[3], point.y_px) &&
         read_number(cells[4], point.v) && std::isfinite(point.x_px) && std::isfinite(point.y_px) &&
         point.v >= 0 && point.v <= 2;
}

// Looks at corrected labels as PictureFit looks at those of the file. A picture without a readable header is
// left to decoding, which tells what is wrong with it.
std::optional<LabelProblem> problem_of(const manifests::SampleRecord& record) {
  if (!(record.box.w_px > 0.0 && record.box.h_px > 0.0)) {
    return LabelProblem{
        Reason::box_missing,
        "got no box in the annotation file, and no keypoint in it to make one around; expected "
        "a box, since corrections give keypoints alone"};
  }
  if (record.image_path.empty()) return std::nullopt;
  const auto header = loaders::pictures::read_picture_header(std::filesystem::path(record.image_path));
  if (!header) return std::nullopt;
  const bool exchanges = loaders::pictures::exchanges_sides(record.orientation);
  return find_label_problem(record, exchanges ? header->height_px : header->width_px,
                            exchanges ? header->width_px : header->height_px);
}

void correct(const std::vector<CorrectedPoint>& points, manifests::SampleRecord& record) {
  if (record.failure != Reason::none && record.failure != Reason::no_visible_keypoints) return;
  for (const CorrectedPoint& point : points) {
    record.keypoints[point.keypoint] = {point.x_px, point.y_px, static_cast<float>(point.v),
                                        point.v > 0 ? 1.0F : 0.0F};
  }
  const bool is_visible = std::any_of(record.keypoints.begin(), record.keypoints.end(),
                                      [](const auto& keypoint) { return keypoint.weight > 0.0F; });
  record.failure = is_visible ? Reason::none : Reason::no_visible_keypoints;
  record.failure_detail = is_visible ? "" : "corrections: no keypoint is labelled any more";
  if (!is_visible) return;
  if (const auto problem = problem_of(record)) {
    record.failure = problem->reason;
    record.failure_detail = "after the corrections: " + problem->detail;
  }
}

}  // namespace

Corrections read_corrections(const std::filesystem::path& file) {
  const ListFile list = read_list_file(file, "corrections");
  Corrections corrections;
  corrections.sha256 = list.sha256;
  for (const auto& [number, line] : list.lines) {
    const std::vector<std::string> cells = cells_of(line);
    CorrectedPoint point;
    if (!read_point(cells, point)) {
      throw run::ConfigError(
          fmt::format("{}: line {}: got \"{}\", expected a sample id, the name of a keypoint, x and y in "
                      "pixels, and v (0, 1 or 2), with tabs between them",
                      file.string(), number, line));
    }
    corrections.points[cells[0]].push_back(point);
  }
  return corrections;
}

std::string corrections_text(const std::map<std::string, std::vector<CorrectedPoint>>& points) {
  std::string text =
      "# sample id, keypoint, x, y (px of the source picture), v: for `quadruped3d build --corrections`\n";
  for (const auto& [id, corrected] : points) {
    for (const CorrectedPoint& point : corrected) {
      text += fmt::format("{}\t{}\t{}\t{}\t{}\n", id, names().at(point.keypoint), point.x_px, point.y_px,
                          point.v);
    }
  }
  return text;
}

void apply_corrections(Corrections& corrections, std::vector<manifests::SampleRecord>& records) {
  for (manifests::SampleRecord& record : records) {
    const auto found = corrections.points.find(record.id);
    if (found == corrections.points.end()) continue;
    ++corrections.matched;
    correct(found->second, record);
  }
}

}  // namespace q3d::pipeline::candidates
