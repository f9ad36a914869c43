#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "loaders/keypoints/topology.h"
#include "pipeline/dataset/inspect.h"
#include "pipeline/dataset/published_dataset.h"
#include "pipeline/dataset/sentences.h"
#include "pipeline/run/command_line.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostSpecies = 10;  // lines of the page
constexpr std::size_t kMostRows = 20;     // samples of a shard's page

std::string line(std::string_view label, const std::string& text) {
  return fmt::format("  {:<14}{}\n", label, text);
}

std::string share(std::int64_t count, std::int64_t of) {
  return of == 0 ? "-"
                 : fmt::format("{:.1f} %", 100.0 * static_cast<double>(count) / static_cast<double>(of));
}

std::string megabytes(std::int64_t bytes) {
  return fmt::format("{:.1f} MB", static_cast<double>(bytes) / 1e6);
}

std::string error_text(double error) {
  return std::isnan(error) ? "not computed" : fmt::format("{:.4f}", error);
}

// Returns a line with a count, its share, its name and its sentence.
std::string counted(std::int64_t count, std::int64_t of, std::string_view name, std::string_view told) {
  return fmt::format("  {:>8} {:>8}  {:<22}  {}\n", count, share(count, of), name, told);
}

std::string verdicts_part(const DatasetManifest& manifest) {
  using manifests::Verdict;
  const Counts& counts = manifest.counts;
  std::string text = "\n" + run::counted(counts.candidates, "candidate") + "\n";
  for (const auto& [verdict, count] :
       {std::pair{Verdict::retained, counts.retained}, std::pair{Verdict::refined, counts.refined},
        std::pair{Verdict::discarded, counts.discarded}, std::pair{Verdict::failed, counts.failed}}) {
    text += counted(count, counts.candidates, manifests::to_string(verdict), sentence(verdict));
  }
  const GroupStatistics& all = manifest.all;
  if (all.mean_initial_error && all.mean_final_error) {
    text += fmt::format(
        "  mean L_proj of the kept ones: {:.4f} as predicted, {:.4f} in the end (crop side = 1)\n",
        *all.mean_initial_error, *all.mean_final_error);
  }
  return text;
}

std::string reasons_part(const DatasetManifest& manifest) {
  if (manifest.reasons.empty()) return {};
  std::vector<std::pair<manifests::Reason, std::int64_t>> reasons(manifest.reasons.begin(),
                                                                  manifest.reasons.end());
  std::stable_sort(reasons.begin(), reasons.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  std::string text = "\nWhy candidates have no label (share of all candidates)\n";
  for (const auto& [reason, count] : reasons) {
    text += counted(count, manifest.counts.candidates, manifests::to_string(reason), sentence(reason));
  }
  return text;
}

std::string labels_part(const DatasetManifest& manifest) {
  const std::int64_t kept = manifest.counts.retained + manifest.counts.refined;
  std::string text = "\n" + run::counted(kept, "label") + "\n";
  for (const auto& [kind, count] : manifest.labels) {
    if (count > 0) text += counted(count, kept, manifests::to_string(kind), sentence(kind));
  }
  return text;
}

std::string group_line(std::string_view name, const Counts& counts) {
  const std::int64_t kept = counts.retained + counts.refined;
  return fmt::format("  {:<24} {:>10} {:>8} {:>8}\n", name, counts.candidates, kept,
                     share(kept, counts.candidates));
}

// Lists all datasets and families, and the most frequent species.
std::string groups_part(const DatasetManifest& manifest) {
  const auto head = [](std::string_view title) {
    return fmt::format("\n{:<26} {:>10} {:>8} {:>8}\n", title, "candidates", "kept", "share");
  };
  std::string text = head("dataset");
  for (const auto& [name, group] : manifest.by_dataset) text += group_line(name, group.counts);
  text += head("family");
  for (const auto& [family, group] : manifest.by_family) {
    text += group_line(manifests::to_string(family), group.counts);
  }
  std::vector<std::pair<std::string, Counts>> species;
  for (const auto& [name, group] : manifest.by_species) species.emplace_back(name, group.counts);
  std::stable_sort(species.begin(), species.end(),
                   [](const auto& a, const auto& b) { return a.second.candidates > b.second.candidates; });
  text += head("species");
  for (std::size_t i = 0; i < std::min(kMostSpecies, species.size()); ++i) {
    text += group_line(species[i].first, species[i].second);
  }
  if (species.size() > kMostSpecies) {
    text += fmt::format("  and {} species more; --json lists all of them\n", species.size() - kMostSpecies);
  }
  return text;
}

std::string rules_part(const DatasetManifest& manifest) {
  std::string text = "\nHow the labels were made\n";
  text += line("profile", manifest.profile);
  if (manifest.thresholds.empty()) text += line("thresholds", "none; no label is a prediction");
  for (const auto& [name, own] : manifest.thresholds) {
    text += line("thresholds", fmt::format("{}: tau_low {:.4f}, tau_high {:.4f}, delta {:.2f}", name,
                                           own.tau_low, own.tau_high, own.delta));
  }
  const bool has_network = !manifest.checkpoint_sha256.empty();
  text += line("network", has_network ? "checkpoint with SHA-256 " + manifest.checkpoint_sha256 : "none");
  if (has_network) text += line("device", manifest.device);
  text += line("toolkit", manifest.toolkit);
  return text;
}

std::string places_part(const PublishedDataset& dataset) {
  std::int64_t bytes = 0;
  for (const ShardEntry& shard : dataset.manifest().shards) bytes += shard.bytes;
  const fs::path stages = dataset.output_folder() / "stages";
  std::string text = "\nWhere things are\n";
  const auto files = static_cast<std::int64_t>(dataset.manifest().shards.size());
  text += line("folder", dataset.folder().string());
  text += line("shards", fmt::format("shards/, {}, {}", run::counted(files, "file"), megabytes(bytes)));
  text += line("verdicts", "verdicts.csv, a line for each candidate");
  text += line("predictions", fs::is_directory(stages)
                                  ? stages.string()
                                  : "not beside the dataset; `explain` can tell less without them");
  return text;
}

// Lists the 26 keypoints in the order of every array, with the index of the first one in each row.
std::string keypoints_part() {
  constexpr std::size_t kPerLine = 6;
  const std::vector<std::string>& names = loaders::keypoints::topology("animal3d26").keypoints;
  std::string text = "\nThe 26 keypoints, in the order of every array of keypoints\n";
  for (std::size_t i = 0; i < names.size(); ++i) {
    const bool ends_line = i % kPerLine == kPerLine - 1 || i + 1 == names.size();
    if (i % kPerLine == 0) text += fmt::format("  {:>2}  ", i);
    text += names[i] + (ends_line ? "\n" : ", ");
  }
  return text;
}

// Lists the next commands. The lines, with their comments, can be pasted into a shell.
std::string next_part(const PublishedDataset& dataset) {
  const std::string folder = dataset.folder().string();
  VerdictReader verdicts(dataset.verdicts_file());
  const auto first = verdicts.next();
  std::string text = "\nWhat to do next\n";
  const auto step = [&](const std::vector<std::string>& words, const char* remark) {
    text += fmt::format("  {}{}\n", run::command_line(words), remark);
  };
  step({"verify", folder}, "");
  step({"inspect", folder, "--sheet", "sheet.png"}, "");
  if (first) step({"explain", folder, first->id}, "    # or another id of verdicts.csv, or a part of one");
  step({"inspect", folder, "--json"}, "    # everything on this page and more, as JSON");
  return text;
}

std::string shard_page(const fs::path& path) {
  const manifests::ShardReader shard(path);
  const std::vector<std::string> ids = shard.table().text("id", 0, shard.rows());
  std::string text = fmt::format("{}\n", path.string());
  text += line("dataset", fmt::format("{}, unit {}", shard.header().dataset, shard.header().unit));
  text += line("schema", std::to_string(shard.header().schema));
  text += line("pictures", std::string(manifests::to_string(shard.header().image_encoding)));
  text += line("samples", std::to_string(shard.rows()));
  for (std::size_t i = 0; i < std::min(kMostRows, ids.size()); ++i) text += "    " + ids[i] + '\n';
  if (ids.size() > kMostRows) {
    text += fmt::format("    and {} more; --json lists all of them\n", ids.size() - kMostRows);
  }
  text += keypoints_part();
  if (ids.empty()) return text;
  return text +
         fmt::format("next: {}\n", run::command_line({"inspect", path.string(), "--sample", ids.front()}));
}

}  // namespace

std::string page(const fs::path& path) {
  if (!fs::is_directory(path)) return shard_page(path);
  const PublishedDataset dataset(path);
  const DatasetManifest& manifest = dataset.manifest();
  return fmt::format("{} {} ({})\n", manifest.name, manifest.version, dataset.version_name()) +
         verdicts_part(manifest) + reasons_part(manifest) + labels_part(manifest) + groups_part(manifest) +
         rules_part(manifest) + keypoints_part() + places_part(dataset) + next_part(dataset);
}

std::string sample_page(const fs::path& path, const std::string& id) {
  const auto [shard, sample] = find_sample(path, id);
  const manifests::SampleRecord& record = sample.record;
  const manifests::Judgement& judgement = sample.judgement;
  const auto visible = std::count_if(record.keypoints.begin(), record.keypoints.end(),
                                     [](const manifests::Keypoint& point) { return point.weight > 0.0F; });
  std::string text = record.id + '\n';
  text += line("label",
               fmt::format("{}. {}", manifests::to_string(sample.label_kind), sentence(sample.label_kind)));
  text += line("L_proj", fmt::format("{} as predicted, {} in the end (crop side = 1)",
                                     error_text(judgement.initial_error), error_text(judgement.final_error)));
  text +=
      line("animal", fmt::format("{}, family {}", record.species.empty() ? "species unknown" : record.species,
                                 manifests::to_string(record.family)));
  text += line("keypoints", fmt::format("{} of {} are visible", visible, record.keypoints.size()));
  text += line("picture", fmt::format("{}, {} x {} px", record.image_ref, sample.image_width_px,
                                      sample.image_height_px));
  text += line("stored crop", sample.crop.empty() ? "none; the shard refers to the picture"
                                                  : fmt::format("{0} x {0} px, {1} bytes",
                                                                sample.crop_side_px, sample.crop.size()));
  text += line("body", fmt::format("pose {}, shape {}, 3D keypoints {}", sample.has_pose ? "yes" : "no",
                                   sample.has_betas ? "yes" : "no", sample.has_keypoints_3d ? "yes" : "no"));
  text += line("shard", shard.string());
  return text + "  --json prints every number of it\n";
}

}  // namespace q3d::pipeline::dataset
