#include "pipeline/dataset/verify.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <stdexcept>
#include <unordered_map>

#include "filters/metrics.h"
#include "loaders/pictures/encode.h"
#include "manifests/digest.h"
#include "manifests/enumerators.h"
#include "manifests/file_descriptor.h"
#include "manifests/shard.h"
#include "pipeline/dataset/published_dataset.h"
#include "pipeline/run/interrupt.h"
#include "pipeline/run/progress.h"
#include "pipeline/stages/stage_check.h"
#include "pipeline/unit/annotated_body.h"
#include "pipeline/unit/crop_keypoints.h"
#include "smal/camera.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;

// The float32 projection and its recomputation in double differ by rounding only. This tolerance is absolute
// for numbers below 1 and relative for larger ones.
constexpr double kProjectionTolerance = 1e-4;
constexpr float kRotationTolerance = 1e-5F;

class Verifier {
 public:
  explicit Verifier(const fs::path& given) : dataset_(given) { summary_.folder = dataset_.folder(); }

  VerifySummary run(bool quiet, bool with_stages) {
    const std::vector<ShardEntry>& shards = dataset_.manifest().shards;
    run::Progress progress("shards", static_cast<std::int64_t>(shards.size()), quiet);
    for (const ShardEntry& entry : shards) {
      run::throw_if_interrupted();
      check_shard(entry);
      progress.advance(1);
    }
    check_books();
    check_verdicts();
    check_labels();
    check_strays();
    if (with_stages) check_stages();
    return summary_;
  }

 private:
  void problem(const std::string& text) {
    const std::lock_guard lock(mutex_);
    summary_.problems.push_back(text);
  }

  void damage(const fs::path& file, const std::string& expected, const std::string& text) {
    problem(text);
    const std::lock_guard lock(mutex_);
    summary_.damage.push_back({file, expected});
  }

  // A file that is gone or too short is damaged. Any other error of the system (EACCES, EIO, ...) says
  // nothing of the file's content, and --repair must not move a sound file away: it ends the verification.
  static void require_damage(const manifests::IoError& error) {
    const bool is_too_short = error.code() == 0;
    if (!error.names_no_file() && !is_too_short) throw error;
  }

  void check_shard(const ShardEntry& entry) {
    ++summary_.shards;
    const fs::path path = dataset_.shard_file(entry);
    try {
      const std::string digest = manifests::sha256_file(path);
      if (digest != entry.sha256) {
        damage(path, entry.sha256,
               fmt::format("{}: SHA-256 is {}, dataset.json says {}", entry.file, digest, entry.sha256));
        return;
      }
      const manifests::Shard shard = manifests::read_shard(path);
      if (static_cast<std::int64_t>(shard.samples.size()) != entry.rows) {
        problem(
            fmt::format("{}: {} rows, dataset.json says {}", entry.file, shard.samples.size(), entry.rows));
      }
      if (shard.header.unit != entry.unit) {
        problem(fmt::format("{}: made from unit {}, dataset.json says {}", entry.file, shard.header.unit,
                            entry.unit));
      }
      check_samples(entry, shard);
    } catch (const manifests::IoError& error) {
      require_damage(error);
      damage(path, entry.sha256, error.what());
    } catch (const std::runtime_error& error) {
      problem(error.what());
    }
  }

  void check_samples(const ShardEntry& entry, const manifests::Shard& shard) {
    tbb::parallel_for(std::size_t{0}, shard.samples.size(), [&](std::size_t i) {
      const manifests::ShardSample& sample = shard.samples[i];
      check_picture(entry, sample);
      check_label(entry, sample);
    });
    for (const manifests::ShardSample& sample : shard.samples) {
      ++summary_.samples;
      ++labels_[sample.label_kind];
      summary_.pictures += sample.crop.empty() ? 0 : 1;
      const bool is_new = ids_.emplace(sample.record.id, sample.judgement.verdict).second;
      if (!is_new) problem(entry.file + ": sample " + sample.record.id + " occurs twice");
      labelled_.add(sample.judgement.verdict);
    }
  }

  void check_picture(const ShardEntry& entry, const manifests::ShardSample& sample) {
    if (sample.crop.empty()) return;
    try {
      const cv::Mat picture = loaders::pictures::decode_stored(sample.crop, 3);
      if (picture.cols != sample.crop_side_px || picture.rows != sample.crop_side_px) {
        problem(fmt::format("{}: {}: the stored crop is {} x {} px, expected {} square", entry.file,
                            sample.record.id, picture.cols, picture.rows, sample.crop_side_px));
      }
    } catch (const std::runtime_error& error) {
      problem(fmt::format("{}: {}: {}", entry.file, sample.record.id, error.what()));
    }
  }

  void check_label(const ShardEntry& entry, const manifests::ShardSample& sample) {
    using manifests::LabelKind;
    const bool is_predicted =
        sample.label_kind == LabelKind::retained || sample.label_kind == LabelKind::refined;
    const bool has_body = sample.has_pose || sample.has_betas || sample.has_keypoints_3d;
    const bool is_whole = sample.has_pose && sample.has_betas && sample.has_keypoints_3d;
    if ((is_predicted && !is_whole) || (sample.label_kind == LabelKind::truth && !sample.has_pose) ||
        (sample.label_kind == LabelKind::two_d_only && has_body)) {
      problem(fmt::format("{}: {}: a {} label with has_pose {}, has_betas {}, has_keypoints_3d {}",
                          entry.file, sample.record.id, manifests::to_string(sample.label_kind),
                          sample.has_pose, sample.has_betas, sample.has_keypoints_3d));
    }
    if (sample.label_kind == LabelKind::truth) check_truth(entry, sample);
    if (is_predicted || unit::has_projection(sample.projected_2d)) check_projection(entry, sample);
  }

  // Checks that the label of a truth is the annotation's own body.
  void check_truth(const ShardEntry& entry, const manifests::ShardSample& sample) {
    const auto& truth = sample.record.truth;
    const device::BodyPrediction body = truth ? unit::annotated_body(*truth) : unit::no_body();
    const bool is_equal =
        truth && truth->has_pose == sample.has_pose && truth->has_betas == sample.has_betas &&
        truth->has_keypoints_3d == sample.has_keypoints_3d &&
        std::equal(body.pose.begin(), body.pose.end(), sample.body.pose.begin(),
                   [](float a, float b) { return std::abs(a - b) <= kRotationTolerance; }) &&
        body.betas == sample.body.betas && body.translation == sample.body.translation &&
        body.keypoints_3d == sample.keypoints_3d &&
        unit::has_projection(body.keypoints_2d) == unit::has_projection(sample.projected_2d);
    if (is_equal) return;
    problem(fmt::format("{}: {}: the label is not the body of the columns truth_*", entry.file,
                        sample.record.id));
  }

  // Checks that the stored 2D points are the projection of the stored body, and that the stored error is
  // theirs.
  void check_projection(const ShardEntry& entry, const manifests::ShardSample& sample) {
    double worst = 0.0;  // relative for what lies far outside the crop
    for (int k = 0; k < manifests::kNumKeypoints; ++k) {
      const auto at = static_cast<std::size_t>(k);
      const std::array stored{sample.projected_2d[at].x, sample.projected_2d[at].y};
      const double z = double{sample.keypoints_3d[3 * at + 2]} + sample.body.translation[2];
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const double point = double{sample.keypoints_3d[3 * at + axis]} + sample.body.translation[axis];
        const double projected = smal::kFocalInCropUnits * point / z;
        const double difference = std::abs(projected - stored[axis]) / std::max(1.0, std::abs(projected));
        worst =
            std::isnan(difference) ? std::numeric_limits<double>::infinity() : std::max(worst, difference);
      }
    }
    if (!(worst <= kProjectionTolerance)) {
      problem(fmt::format("{}: {}: projected_2d differs from the projected body by {} crop units", entry.file,
                          sample.record.id, worst));
    }
    const auto error = filters::projection_error(sample.projected_2d, unit::crop_keypoints(sample.record));
    if (!error ||
        !(std::abs(*error - sample.judgement.final_error) <= kProjectionTolerance * std::max(1.0, *error))) {
      problem(fmt::format("{}: {}: final_error is {}, recomputed {}", entry.file, sample.record.id,
                          sample.judgement.final_error, error.value_or(std::nan(""))));
    }
  }

  void check_books() {
    const DatasetManifest& manifest = dataset_.manifest();
    if (content_id(manifest.shards) != manifest.content_id) {
      problem("dataset.json: content_id is not the hash of the shard digests that it lists");
    }
    try {
      if (manifests::sha256_file(dataset_.verdicts_file()) != manifest.verdicts_sha256) {
        damage(dataset_.verdicts_file(), manifest.verdicts_sha256,
               "verdicts.csv: its SHA-256 is not the one in dataset.json");
      }
    } catch (const manifests::IoError& error) {
      require_damage(error);
      damage(dataset_.verdicts_file(), manifest.verdicts_sha256, error.what());
    }
    const Counts& counts = manifest.counts;
    if (counts.retained + counts.refined + counts.discarded + counts.failed != counts.candidates) {
      problem(fmt::format(
          "dataset.json: {} retained + {} refined + {} discarded + {} failed are not {} candidates",
          counts.retained, counts.refined, counts.discarded, counts.failed, counts.candidates));
    }
    if (labelled_.retained != counts.retained || labelled_.refined != counts.refined) {
      problem(fmt::format("the shards hold {} retained and {} refined samples, dataset.json says {} and {}",
                          labelled_.retained, labelled_.refined, counts.retained, counts.refined));
    }
  }

  // Checks that verdicts.csv has the same candidates as dataset.json and the shards.
  void check_verdicts() {
    Counts counts;
    std::size_t kept = 0;
    std::size_t foreign = 0;  // kept ones that no shard holds with this verdict
    try {
      VerdictReader reader(dataset_.verdicts_file());
      while (const auto row = reader.next()) {
        counts.add(row->judgement.verdict);
        if (!manifests::is_kept(row->judgement.verdict)) continue;
        ++kept;
        const auto found = ids_.find(row->id);
        foreign += found == ids_.end() || found->second != row->judgement.verdict ? 1 : 0;
      }
    } catch (const std::runtime_error& error) {
      problem(error.what());
      return;
    }
    const Counts& listed = dataset_.manifest().counts;
    if (counts != listed) {
      problem(fmt::format(
          "verdicts.csv has {} candidates ({} retained, {} refined, {} discarded, {} failed), dataset.json "
          "says {} ({}, {}, {}, {})",
          counts.candidates, counts.retained, counts.refined, counts.discarded, counts.failed,
          listed.candidates, listed.retained, listed.refined, listed.discarded, listed.failed));
    }
    if (foreign > 0 || kept != ids_.size()) {
      problem(
          fmt::format("verdicts.csv keeps {} candidates and the shards hold {}; {} of the first are not "
                      "among the second with their verdict",
                      kept, ids_.size(), foreign));
    }
  }

  void check_labels() {
    for (const auto& [kind, count] : dataset_.manifest().labels) {
      if (labels_[kind] != count) {
        problem(fmt::format("the shards hold {} {} labels, dataset.json says {}", labels_[kind],
                            manifests::to_string(kind), count));
      }
    }
  }

  // Reports files that dataset.json does not list, because they are not part of the dataset.
  void check_strays() {
    std::set<std::string> listed{"dataset.json", "verdicts.csv", "shards"};
    for (const ShardEntry& entry : dataset_.manifest().shards) listed.insert(entry.file);
    for (const char* folder : {"", "shards"}) {
      std::error_code error;
      for (const auto& file : fs::directory_iterator(dataset_.folder() / folder, error)) {
        const std::string name = (fs::path(folder) / file.path().filename()).string();
        if (!listed.contains(name)) problem(name + ": not listed in dataset.json");
      }
    }
  }

  void check_stages() {
    const stages::StageCheck check = stages::check_stages(dataset_.output_folder());
    summary_.stage_files = check.files;
    for (const stages::StageProblem& found : check.problems) {
      damage(found.file, found.expected,
             fmt::format("{}: {}", found.file.lexically_relative(dataset_.output_folder()).string(),
                         found.text));
    }
  }

  PublishedDataset dataset_;
  VerifySummary summary_;
  std::mutex mutex_;                                         // guards summary_.problems
  std::unordered_map<std::string, manifests::Verdict> ids_;  // of the samples in the shards
  Counts labelled_;
  std::map<manifests::LabelKind, std::int64_t> labels_;
};

}  // namespace

VerifySummary verify(const fs::path& given, bool quiet, bool with_stages) {
  return Verifier(given).run(quiet, with_stages);
}

}  // namespace q3d::pipeline::dataset
