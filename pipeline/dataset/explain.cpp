#include "pipeline/dataset/explain.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "loaders/keypoints/topology.h"
#include "loaders/pictures/crop.h"
#include "manifests/atomic_file.h"
#include "manifests/csv.h"
#include "manifests/shard.h"
#include "pipeline/config/json_fields.h"
#include "pipeline/dataset/dataset_manifest.h"
#include "pipeline/stages/stage_store.h"
#include "pipeline/unit/crop_keypoints.h"
#include "pipeline/unit/unit_tables.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

using Projection = std::array<float, manifests::kNumKeypoints * 2>;  // crop units

// The candidate's line of verdicts.csv, by column, and its place in ingest order.
struct VerdictLine {
  std::map<std::string, std::string> cells;
  std::size_t position = 0;

  const std::string& at(const char* column) const { return cells.at(column); }
};

// What is known of the candidate besides its verdict's line.
struct Evidence {
  manifests::SampleRecord record;  // id, image_ref, box and keypoints
  std::optional<Projection> before;
  std::optional<Projection> after;
  std::vector<double> curve;
  std::vector<double> held_out_curve;
  std::optional<filters::LabelMeasures> measures;
  std::vector<std::string> missing;
};

[[noreturn]] void no_such_id(const std::string& id, const std::vector<std::string>& near,
                             const fs::path& file) {
  const std::string nearest = config::nearest_word(id, near);
  throw std::runtime_error(fmt::format("{}: no candidate {}{}", file.string(), id,
                                       nearest.empty() ? "" : fmt::format("; the nearest is {}", nearest)));
}

VerdictLine find_line(const fs::path& file, const std::string& id) {
  const std::string text = manifests::read_file(file);
  manifests::CsvReader lines(text, file.string());
  std::vector<std::string> header;
  std::vector<std::string> cells;
  std::vector<std::string> near;  // ids that share the picture's last part, or the first few
  lines.next(header);
  const std::string part = id.substr(id.rfind('/') + 1);
  for (std::size_t position = 0; lines.next(cells); ++position) {
    if (cells.size() != header.size()) {
      lines.fail(fmt::format("{} cells", cells.size()), std::to_string(header.size()));
    }
    if (cells[0] == id) {
      VerdictLine line;
      for (std::size_t i = 0; i < header.size(); ++i) line.cells[header[i]] = cells[i];
      line.position = position;
      return line;
    }
    const bool is_near = cells[0].find(part.substr(0, part.find('#'))) != std::string::npos;
    if (near.size() < 1000 && (is_near || near.size() < 10)) near.push_back(cells[0]);
  }
  no_such_id(id, near, file);
}

ordered_json number_or_null(const std::string& cell) {
  return cell.empty() ? ordered_json(nullptr) : ordered_json(std::stod(cell));
}

ordered_json number_or_null(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

// The stage's table of the candidate's unit, if it is still there.
std::optional<manifests::Table> stage_table(const fs::path& folder, const json& dataset, const char* stage,
                                            std::int64_t unit) {
  const std::string key = dataset.at("provenance").at("stage_keys").at(stage).get<std::string>();
  // <out>/<name>-<key> lies beside <out>/stages; `latest` leads there too.
  const fs::path file =
      stages::unit_file(stages::stage_folder(fs::canonical(folder).parent_path(), stage, key), unit);
  if (!fs::exists(file)) return std::nullopt;
  return manifests::read_table(file);
}

void read_stages(const fs::path& folder, const json& dataset, const VerdictLine& line, Evidence& evidence) {
  const json shards = dataset.at("provenance").at("config").value("shards", json::object());
  const auto unit_size = static_cast<std::size_t>(shards.value("unit_size", config::ShardConfig{}.unit_size));
  const auto unit = static_cast<std::int64_t>(line.position / unit_size);
  const std::size_t row = line.position % unit_size;
  const auto predicted = stage_table(folder, dataset, "predict", unit);
  const bool is_there = predicted && row < static_cast<std::size_t>(predicted->rows) &&
                        unit::candidate_from_table(*predicted, row).id == line.at("id");
  if (!is_there) {
    evidence.missing.emplace_back(
        "predictions: the stage's folder is gone, or was made anew for other candidates");
    return;
  }
  evidence.record = unit::candidate_from_table(*predicted, row);
  const unit::PredictedSample sample = unit::predicted_from_table(*predicted)[row];
  if (sample.failure == manifests::Reason::none) evidence.before = sample.body.keypoints_2d;
  const auto refined = stage_table(folder, dataset, "refine", unit);
  if (!refined) return;
  for (unit::RefinedSample& each : unit::refined_from_table(*refined)) {
    if (each.sample != row) continue;
    evidence.curve = std::move(each.curve);
    evidence.held_out_curve = std::move(each.held_out_curve);
    evidence.after = each.body.keypoints_2d;
  }
  if (dataset.at("provenance").at("stage_keys").at("measure").is_null()) return;
  const auto measured = stage_table(folder, dataset, "measure", unit);
  if (!measured) return;
  for (const unit::MeasuredLabel& each : unit::measured_from_table(*measured)) {
    if (each.sample == row) evidence.measures = each.measures;
  }
}

// A kept sample's label is in its shard, wherever the dataset was taken.
void read_shard(const fs::path& folder, const VerdictLine& line, Evidence& evidence) {
  if (line.at("shard").empty()) return;
  const manifests::ShardReader shard(folder / fmt::format("shards/{:06}.h5", std::stoll(line.at("shard"))));
  const manifests::ShardSample sample = shard.samples(std::stoll(line.at("row")), 1).front();
  evidence.record = sample.record;
  if (sample.has_keypoints_3d) evidence.after = sample.projected_2d;
}

// (|dx| + |dy|) / 2: the mean of these over the visible keypoints is L_proj.
ordered_json keypoint_error(const std::optional<Projection>& projected,
                            const device::CropKeypoints& annotated, std::size_t k) {
  if (!projected || !(annotated[3 * k + 2] > 0.0F)) return nullptr;
  const double dx = double{(*projected)[2 * k]} - annotated[3 * k];
  const double dy = double{(*projected)[2 * k + 1]} - annotated[3 * k + 1];
  return number_or_null((std::abs(dx) + std::abs(dy)) / 2.0);
}

ordered_json describe_keypoints(const Evidence& evidence) {
  const std::vector<std::string>& names = loaders::keypoints::topology("animal3d26").keypoints;
  const device::CropKeypoints annotated = unit::crop_keypoints(evidence.record);
  ordered_json list = ordered_json::array();
  for (std::size_t k = 0; k < names.size(); ++k) {
    const manifests::Keypoint& point = evidence.record.keypoints[k];
    list.push_back({{"name", names[k]},
                    {"v", number_or_null(point.v)},
                    {"weight", point.weight},
                    {"annotated_px", {point.x_px, point.y_px}},
                    {"error_before", keypoint_error(evidence.before, annotated, k)},
                    {"error_after", keypoint_error(evidence.after, annotated, k)}});
  }
  return list;
}

ordered_json describe_crop(const manifests::SampleRecord& record) {
  const loaders::pictures::SquareBox square = loaders::pictures::square_box(record.box);
  return {{"box_xywh_px", {record.box.x_px, record.box.y_px, record.box.w_px, record.box.h_px}},
          {"center_px", {square.center_x_px, square.center_y_px}},
          {"side_px", square.side_px},
          {"patch_side_px", loaders::pictures::kPatchSidePx},
          {"patch_from_image", loaders::pictures::patch_from_image(square, loaders::pictures::kPatchSidePx)}};
}

// What the guards' bounds looked at; null where there was nothing to measure or the bound is off.
ordered_json describe_measures(const filters::LabelMeasures& measures) {
  return {{"visible", measures.visible},
          {"pose_deviation", number_or_null(measures.pose_deviation)},
          {"limb_factor", number_or_null(measures.limb_factor)},
          {"left_right", number_or_null(measures.left_right)},
          {"mask_iou", number_or_null(measures.mask_iou)}};
}

ordered_json describe_verdict(const VerdictLine& line) {
  ordered_json verdict = {
      {"verdict", line.at("verdict")}, {"reason", line.at("reason")}, {"detail", line.at("detail")}};
  for (const char* key : {"initial_error", "final_error", "gain", "iterations", "best_iteration"}) {
    verdict[key] = number_or_null(line.at(key));
  }
  return verdict;
}

ordered_json describe_source(const VerdictLine& line, const Evidence& evidence) {
  return {{"dataset", line.at("dataset")},
          {"split", line.at("split")},
          {"source", line.at("source")},
          {"species", line.at("species")},
          {"family", line.at("family")},
          {"picture", evidence.record.image_ref},
          {"image_sha256", line.at("image_sha256")}};
}

// Those of the candidate's dataset; null where its labels are no predictions.
json thresholds_of(const json& dataset, const std::string& name) {
  const json& all = dataset.at("thresholds");
  return all.is_object() && all.contains(name) ? all.at(name) : json(nullptr);
}

bool is_from_a_guard(const std::string& reason) {
  static const std::set<std::string> kReasons{
      "too_few_keypoints", "scaled_gain_too_small", "held_out_not_better", "pose_implausible",
      "limbs_implausible", "left_right_swapped",    "mask_mismatch"};
  return kReasons.count(reason) > 0;
}

// What decided, in the numbers of this sample.
std::string why(const ordered_json& verdict, const json& thresholds) {
  const auto text = [&](const char* key) { return verdict.at(key).get<std::string>(); };
  if (text("verdict") == "failed") return "It failed before it could be judged: " + text("detail") + ".";
  if (text("reason") == "in_test_split") return "It was left out because " + text("detail") + ".";
  if (text("reason") == "vetoed") return "It was left out by the veto list: " + text("detail") + ".";
  if (verdict.at("initial_error").is_null()) {
    return "Its label comes from the annotation file; the fidelity rule judges predictions only.";
  }
  if (is_from_a_guard(text("reason"))) return "A guard left it out: " + text("detail") + ".";
  const double error = verdict.at("initial_error").get<double>();
  const double low = thresholds.at("tau_low").get<double>();
  const double high = thresholds.at("tau_high").get<double>();
  if (text("verdict") == "retained") {
    return fmt::format("L_proj of the prediction, {:.4f}, lies below tau_low = {:.4f}: kept as it is.", error,
                       low);
  }
  if (text("reason") == "error_too_large") {
    return fmt::format(
        "L_proj of the prediction, {:.4f}, reaches tau_high = {:.4f}: too far off to be refined.", error,
        high);
  }
  const std::string adapted = fmt::format(
      "L_proj of the prediction, {:.4f}, lies between tau_low = {:.4f} and tau_high = {:.4f}: it was "
      "adapted, {} "
      "iterations, and fell to {:.4f} at iteration {}.",
      error, low, high, std::llround(verdict.at("iterations").get<double>()),
      verdict.at("final_error").get<double>(), std::llround(verdict.at("best_iteration").get<double>()));
  const double gain = verdict.at("gain").is_null() ? std::nan("") : verdict.at("gain").get<double>();
  const double delta = thresholds.at("delta").get<double>();
  if (text("reason") == "gain_too_small") {
    return adapted +
           fmt::format(" Its gain within the first iterations, {:.2f} %, is less than delta = {:.2f} %.",
                       100 * gain, 100 * delta);
  }
  const bool fell_below = verdict.at("final_error").get<double>() < low;
  return adapted + (fell_below
                        ? fmt::format(" That is below tau_low: kept.")
                        : fmt::format(" Its gain within the first iterations, {:.2f} %, reaches delta = "
                                      "{:.2f} %: kept.",
                                      100 * gain, 100 * delta));
}

}  // namespace

ordered_json explain(const fs::path& given, const std::string& id) {
  const fs::path folder = dataset_folder(given);
  read_dataset_manifest(folder);  // refuses what it does not know
  const json dataset = json::parse(manifests::read_file(folder / "dataset.json"));
  const VerdictLine line = find_line(folder / "verdicts.csv", id);
  Evidence evidence;
  read_stages(folder, dataset, line, evidence);
  if (evidence.record.id.empty()) read_shard(folder, line, evidence);

  ordered_json story = {{"id", id}, {"dataset", fs::canonical(folder).filename().string()}};
  story["verdict"] = describe_verdict(line);
  const json thresholds = thresholds_of(dataset, line.at("dataset"));
  story["thresholds"] = thresholds;
  story["why"] = why(story["verdict"], thresholds);
  story["source"] = describe_source(line, evidence);
  if (!evidence.record.id.empty() && evidence.record.box.w_px > 0) {
    story["crop"] = describe_crop(evidence.record);
    story["keypoints"] = describe_keypoints(evidence);
  }
  if (!evidence.curve.empty()) {
    story["curve"] = ordered_json::array();
    for (const double error : evidence.curve) story["curve"].push_back(number_or_null(error));
  }
  if (!evidence.held_out_curve.empty()) story["held_out_curve"] = evidence.held_out_curve;
  if (evidence.measures) story["measures"] = describe_measures(*evidence.measures);
  if (!line.at("shard").empty()) {
    story["label"] = {{"shard", fmt::format("shards/{:06}.h5", std::stoll(line.at("shard")))},
                      {"row", std::stoll(line.at("row"))}};
  }
  if (!evidence.missing.empty()) story["missing"] = evidence.missing;
  return story;
}

}  // namespace q3d::pipeline::dataset
