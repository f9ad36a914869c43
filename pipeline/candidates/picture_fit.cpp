#include "pipeline/candidates/picture_fit.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "loaders/pictures/orientation.h"
#include "loaders/pictures/picture_header.h"
#include "pipeline/candidates/label_checks.h"
#include "pipeline/run/interrupt.h"

namespace q3d::pipeline::candidates {
namespace {

using loaders::formats::NoteKind;
using loaders::pictures::PictureHeader;
using manifests::Reason;
using manifests::SampleRecord;

struct Size {
  int width_px = 0;
  int height_px = 0;

  bool operator==(const Size&) const = default;
  Size exchanged() const { return {height_px, width_px}; }
  std::string text() const { return fmt::format("{} x {}", width_px, height_px); }
};

// Returns whether a stated size, of which a side may be unknown (0), agrees with this one.
bool agrees(const Size& stated, const Size& size) {
  return (stated.width_px == 0 || stated.width_px == size.width_px) &&
         (stated.height_px == 0 || stated.height_px == size.height_px);
}

// Returns the factor by which a picture was resized, if both sides agree with it to a pixel.
std::optional<double> uniform_factor(const Size& from, const Size& to) {
  if (from.width_px == 0 || from.height_px == 0) return std::nullopt;
  const double longer_from = std::max(from.width_px, from.height_px);
  const double factor = (from.width_px >= from.height_px ? to.width_px : to.height_px) / longer_from;
  const bool fits = std::abs(from.width_px * factor - to.width_px) <= 1.0 &&
                    std::abs(from.height_px * factor - to.height_px) <= 1.0;
  return fits ? std::optional(factor) : std::nullopt;
}

// A record that failed because it has no labelled keypoint is fitted too, since corrections may give it some.
bool is_fitted(const SampleRecord& record) {
  const bool may_be_used = record.failure == Reason::none || record.failure == Reason::no_visible_keypoints;
  return may_be_used && !record.image_path.empty();
}

using Headers = std::map<std::string, std::optional<PictureHeader>>;  // by path

Headers read_headers(const std::vector<SampleRecord>& records) {
  Headers headers;
  for (const SampleRecord& record : records) {
    if (is_fitted(record)) headers[record.image_path];
  }
  std::vector<Headers::value_type*> entries;
  for (auto& entry : headers) entries.push_back(&entry);
  tbb::parallel_for(std::size_t{0}, entries.size(), [&](std::size_t i) {
    if (!run::interrupted()) {
      entries[i]->second = loaders::pictures::read_picture_header(std::filesystem::path(entries[i]->first));
    }
  });
  run::throw_if_interrupted();
  return headers;
}

class HeaderFit {
 public:
  HeaderFit(const config::DatasetConfig& options, loaders::formats::Notes& notes)
      : options_(options), notes_(notes) {}

  void fit(SampleRecord& record, const PictureHeader& header) {
    const Size stored{header.width_px, header.height_px};
    if (is_too_large(record, stored)) return;
    const bool exchanges = loaders::pictures::exchanges_sides(header.orientation);
    const Size turned = exchanges ? stored.exchanged() : stored;
    if (options_.turns_by_exif) record.orientation = header.orientation;
    const Size size = options_.turns_by_exif ? turned : stored;
    if (!fit_size(record, header, size)) return;
    record.width_px = record.width_px == 0 ? 0 : size.width_px;
    record.height_px = record.height_px == 0 ? 0 : size.height_px;
    if (record.failure != Reason::none) return;  // it has no labels that could be looked at
    if (const auto problem = find_label_problem(record, size.width_px, size.height_px)) {
      record.failure = problem->reason;
      record.failure_detail = problem->detail;
    } else if (keypoints_outside(record, size.width_px, size.height_px) > 0) {
      notes_.count("visible keypoints outside the picture are kept", record.id);
    }
  }

 private:
  // Refuses a picture by its header, before anything takes memory for its pixels.
  bool is_too_large(SampleRecord& record, const Size& stored) const {
    constexpr double kMega = 1e6;
    const double megapixels = static_cast<double>(stored.width_px) * stored.height_px / kMega;
    if (megapixels <= options_.max_picture_megapixels) return false;
    record.failure = Reason::image_too_large;
    record.failure_detail =
        fmt::format("got a picture of {} px, expected at most {:g} megapixels (max_picture_megapixels)",
                    stored.text(), options_.max_picture_megapixels);
    return true;
  }

  // Compares the stated size with the picture's. Returns false if the record failed.
  bool fit_size(SampleRecord& record, const PictureHeader& header, const Size& size) {
    const Size stated{record.width_px, record.height_px};
    const Size stored{header.width_px, header.height_px};
    if (agrees(stated, size)) {
      if (!options_.turns_by_exif && header.orientation != 1) {
        notes_.count(
            "the picture has an EXIF orientation that turns it, and its labels are taken for the pixels as "
            "stored. If they were made on the turned picture, as browsers and most labelling tools show it, "
            "set \"orientation\": \"exif\" in the dataset",
            record.id, NoteKind::caution);
      }
      return true;
    }
    if (options_.turns_by_exif && agrees(stated, stored)) {
      notes_.count(
          "the stated size is that of the stored pixels, while the labels are taken for the picture as EXIF "
          "turns it",
          record.id);
      return true;
    }
    const auto factor = uniform_factor(stated, size);
    if (factor && options_.scales_resized) {
      scale(record, *factor);
      return true;
    }
    record.failure = Reason::size_mismatch;
    record.failure_detail = fmt::format("got {} px in the annotation file and {} px in the picture{}",
                                        stated.text(), size.text(), explanation(stated, size, header));
    return false;
  }

  // Scales box and keypoints. COCO's tools measure from the corner of the first pixel, so resizing a picture
  // only scales coordinates.
  void scale(SampleRecord& record, double factor) {
    record.scale = factor;
    record.box = {record.box.x_px * factor, record.box.y_px * factor, record.box.w_px * factor,
                  record.box.h_px * factor};
    for (manifests::Keypoint& point : record.keypoints) {
      point.x_px *= factor;
      point.y_px *= factor;
    }
    notes_.count("the picture was resized after labelling, and the labels are scaled with it", record.id,
                 NoteKind::caution);
  }

  std::string explanation(const Size& stated, const Size& size, const PictureHeader& header) const {
    const bool has_turned_side =
        !options_.turns_by_exif && loaders::pictures::exchanges_sides(header.orientation);
    const std::string exif = fmt::format(
        ", whose EXIF orientation is {}: the labels were made on the picture as EXIF turns it. Set "
        "\"orientation\": \"exif\" in the dataset to turn the picture",
        header.orientation);
    if (has_turned_side && agrees(stated, size.exchanged())) return exif;
    if (has_turned_side && uniform_factor(stated, size.exchanged()) && !uniform_factor(stated, size)) {
      return exif + ", and \"resized\": \"scale\", since it was resized as well";
    }
    if (agrees(stated, size.exchanged())) {
      return ": width and height are exchanged, so the labels belong to the picture before it was turned, "
             "and it has no EXIF orientation that would turn it back";
    }
    if (const auto factor = uniform_factor(stated, size)) {
      return fmt::format(
          ": it was resized by {:.4g} after labelling, or is another picture. Set \"resized\": "
          "\"scale\" in the dataset to scale the labels with it",
          *factor);
    }
    return ": it is another picture, or was cropped or stretched after labelling";
  }

  const config::DatasetConfig& options_;
  loaders::formats::Notes& notes_;
};

}  // namespace

void PictureFit::fit(std::vector<SampleRecord>& records) {
  const Headers headers = read_headers(records);
  HeaderFit fit(options_, notes_);
  for (SampleRecord& record : records) {
    if (!is_fitted(record)) continue;
    if (const auto& header = headers.at(record.image_path)) fit.fit(record, *header);
  }
}

}  // namespace q3d::pipeline::candidates
