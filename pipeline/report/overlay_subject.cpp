#include "pipeline/report/overlay_subject.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "loaders/pictures/encode.h"
#include "loaders/pictures/image.h"
#include "loaders/pictures/orientation.h"
#include "loaders/pictures/stored_crop.h"
#include "manifests/enumerators.h"
#include "pipeline/dataset/sentences.h"
#include "pipeline/unit/annotated_body.h"

namespace q3d::pipeline::report {
namespace {

using manifests::LabelKind;

// A source picture is reduced to at most this side, which exceeds the pixels in which the widest panel shows
// the box.
constexpr int kPictureSidePx = 720;

std::optional<device::BodyPrediction> with_projection(const device::BodyPrediction& body) {
  return unit::has_projection(body.keypoints_2d) ? std::optional(body) : std::nullopt;
}

MappedPicture stored_picture(const manifests::ShardSample& sample) {
  return {loaders::pictures::decode_stored(sample.crop, 3), sample.crop_from_image};
}

// A mesh needs pose and shape; a body without one of them has keypoints only, and is not drawn.
std::optional<device::BodyPrediction> label_of(const manifests::ShardSample& sample) {
  if (!sample.has_pose || !sample.has_betas) return std::nullopt;
  device::BodyPrediction body;
  static_cast<smal::Body&>(body) = sample.body;
  body.keypoints_3d = sample.keypoints_3d;
  body.keypoints_2d = sample.projected_2d;
  return with_projection(body);
}

// The tables of one unit.
struct UnitTables {
  std::optional<dataset::UnitPredictions> predictions;
  std::map<std::size_t, device::BodyPrediction> adapted;  // by place
};

UnitTables read_tables(const dataset::PublishedDataset& dataset, std::int64_t unit) {
  UnitTables tables;
  tables.predictions = dataset.predictions(unit);
  if (auto refined = dataset.refinements(unit)) {
    for (const unit::RefinedSample& sample : *refined) tables.adapted[sample.sample] = sample.body;
  }
  return tables;
}

class SubjectReader {
 public:
  SubjectReader(const dataset::PublishedDataset& dataset, const SourceFiles& files)
      : dataset_(dataset), files_(files) {}

  OverlaySubject read(const dataset::VerdictRow& row) {
    OverlaySubject subject;
    subject.row = row;
    subject.why = why(row);
    read_stages(row, subject);
    if (row.label) read_shard(row, subject);
    if (subject.picture.rgb.empty()) read_source(row, subject);
    return subject;
  }

 private:
  std::string why(const dataset::VerdictRow& row) const {
    const auto found = dataset_.manifest().thresholds.find(row.dataset);
    const auto thresholds =
        found == dataset_.manifest().thresholds.end() ? std::nullopt : std::optional(found->second);
    return dataset::why(row.judgement, dataset_.role(row), thresholds);
  }

  // Reads the tables of the stages. Reads nothing if the folder is gone or the tables belong to other
  // candidates.
  void read_stages(const dataset::VerdictRow& row, OverlaySubject& subject) {
    const std::int64_t unit = dataset_.unit_of(row);
    if (unit != unit_) {
      tables_ = read_tables(dataset_, unit);
      unit_ = unit;
    }
    const std::size_t place = dataset_.place_in_unit(row);
    const auto& predictions = tables_.predictions;
    if (!predictions || place >= predictions->candidates.size() ||
        predictions->candidates[place].id != row.id) {
      return;
    }
    subject.record = predictions->candidates[place];
    subject.has_geometry = subject.record.box.w_px > 0 && subject.record.box.h_px > 0;
    const bool is_pseudo = dataset_.role(row) == config::Role::pseudo;
    const unit::PredictedSample& predicted = predictions->samples[place];
    subject.image_size = {predicted.image_width_px, predicted.image_height_px};
    if (!is_pseudo || predicted.failure != manifests::Reason::none) return;
    subject.prediction = with_projection(predicted.body);
    if (row.label) return;
    const auto adapted = tables_.adapted.find(place);
    if (adapted != tables_.adapted.end()) subject.dropped = with_projection(adapted->second);
  }

  void read_shard(const dataset::VerdictRow& row, OverlaySubject& subject) {
    OverlaySubject kept = subject_of(dataset_.sample(row));
    subject.record = std::move(kept.record);
    subject.has_geometry = kept.has_geometry;
    subject.image_size = kept.image_size;
    subject.label = kept.label;
    subject.picture = std::move(kept.picture);
  }

  void read_source(const dataset::VerdictRow& row, OverlaySubject& subject) {
    if (!subject.has_geometry) {
      subject.no_picture = "the predictions of its unit are gone, and with them its box";
      return;
    }
    const auto file = files_.picture(row.id, row.image_sha256);
    if (!file) {
      subject.no_picture = row.image_sha256.empty()
                               ? "the picture was not there when the dataset was built"
                               : "the picture was not found: it was moved or changed (--config may help)";
      return;
    }
    const loaders::pictures::DecodedImage image = loaders::pictures::decode_image(file->bytes);
    if (image.failure != manifests::Reason::none) {
      subject.no_picture = image.detail;
      return;
    }
    const cv::Mat upright = loaders::pictures::turned(image.rgb, file->orientation);
    if (upright.size() != subject.image_size) {
      subject.no_picture = "its labels are of the turned picture: give --config with the build's config";
      return;
    }
    loaders::pictures::StoredCrop crop = loaders::pictures::make_stored_crop(
        upright, {}, subject.box(), loaders::pictures::kStoredCropScale, kPictureSidePx);
    subject.picture = {std::move(crop.rgb), crop.from_image};
  }

  const dataset::PublishedDataset& dataset_;
  const SourceFiles& files_;
  std::int64_t unit_ = -1;  // the unit whose tables are in tables_
  UnitTables tables_;
};

}  // namespace

const device::BodyPrediction* OverlaySubject::shown() const {
  for (const auto* body : {&label, &dropped, &prediction}) {
    if (*body) return &**body;
  }
  return nullptr;
}

OverlaySubject subject_of(const manifests::ShardSample& sample) {
  OverlaySubject subject;
  subject.row.id = sample.record.id;
  subject.row.judgement = sample.judgement;
  subject.row.dataset = sample.record.dataset;
  subject.row.split = sample.record.split;
  subject.row.species = sample.record.species;
  subject.row.family = sample.record.family;
  subject.record = sample.record;
  subject.has_geometry = true;
  subject.image_size = {sample.image_width_px, sample.image_height_px};
  subject.label = label_of(sample);
  if (!sample.crop.empty()) subject.picture = stored_picture(sample);
  return subject;
}

std::vector<OverlaySubject> read_subjects(const dataset::PublishedDataset& dataset, const SourceFiles& files,
                                          std::span<const dataset::VerdictRow> rows) {
  std::vector<std::size_t> order(rows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return rows[a].position < rows[b].position; });
  SubjectReader reader(dataset, files);
  std::vector<OverlaySubject> subjects(rows.size());
  for (const std::size_t i : order) subjects[i] = reader.read(rows[i]);
  return subjects;
}

}  // namespace q3d::pipeline::report
