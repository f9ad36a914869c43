#include "loaders/formats/dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "loaders/formats/bounded_text.h"
#include "loaders/formats/formats.h"
#include "loaders/keypoints/builtin_topologies.h"
#include "loaders/pictures/box.h"
#include "manifests/valid_utf8.h"

namespace q3d::loaders::formats {
namespace {

using manifests::Family;
using manifests::Reason;
using manifests::SampleRecord;

using Parser = Dataset (*)(const DatasetOptions&);
using PieceParser = Dataset (*)(const DatasetOptions&, const TakeRecords&);
struct Format {
  const char* name = nullptr;
  Parser parser = nullptr;  // null if the format is read piece by piece
  bool takes_topology = false;
  PieceParser piece_parser = nullptr;
};
// SLEAP's and Lightning Pose's files are tables of the same kind as DeepLabCut's, so all three share a
// parser.
constexpr std::array<Format, 10> kFormats{{{"prima", nullptr, false, stream_prima},
                                           {"superanimal", load_superanimal},
                                           {"animal_kingdom", load_animal_kingdom},
                                           {"stanfordextra", load_stanford_extra},
                                           {"badja", load_badja},
                                           {"coco", load_coco_labels, true},
                                           {"deeplabcut", load_deeplabcut, true},
                                           {"sleap", load_deeplabcut, true},
                                           {"lightning_pose", load_deeplabcut, true},
                                           {"photographs", load_photographs}}};

// Name and split are the first two parts of a sample id and must be separable from the rest.
void require_id_part(const std::string& part, const char* option) {
  const bool is_usable = !part.empty() && part.find_first_of("/#\\") == std::string::npos &&
                         std::none_of(part.begin(), part.end(), [](unsigned char c) { return c < 0x20; });
  if (!is_usable) {
    throw std::invalid_argument(fmt::format(
        "dataset {}: got \"{}\", expected a text without /, \\, # and control characters", option, part));
  }
}

const Format& format_of(const DatasetOptions& options) {
  require_id_part(options.name, "name");
  require_id_part(options.split, "split");
  std::string known;
  for (const Format& format : kFormats) {
    if (options.format == format.name) return format;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", format.name);
  }
  throw std::invalid_argument(
      fmt::format("dataset {}: format: got \"{}\", expected one of {}", options.name, options.format, known));
}

// Notes name files, and are written as JSON.
std::vector<Note> valid_notes(const Notes& notes) {
  std::vector<Note> list = notes.list();
  for (Note& note : list) note.text = manifests::valid_utf8(note.text);
  return list;
}

}  // namespace

std::vector<std::string> dataset_formats() {
  std::vector<std::string> names;
  names.reserve(kFormats.size());
  for (const Format& format : kFormats) names.emplace_back(format.name);
  return names;
}

bool takes_topology(const std::string& format) {
  return std::any_of(kFormats.begin(), kFormats.end(),
                     [&](const Format& each) { return each.name == format && each.takes_topology; });
}

Dataset load_dataset(const DatasetOptions& options) {
  const Format& format = format_of(options);
  if (format.parser != nullptr) return format.parser(options);
  std::vector<SampleRecord> records;
  Dataset dataset = format.piece_parser(options, [&](std::vector<SampleRecord>&& part) {
    records.insert(records.end(), std::make_move_iterator(part.begin()), std::make_move_iterator(part.end()));
  });
  dataset.records = std::move(records);
  return dataset;
}

Dataset stream_dataset(const DatasetOptions& options, const TakeRecords& take) {
  const Format& format = format_of(options);
  if (format.piece_parser != nullptr) return format.piece_parser(options, take);
  Dataset dataset = format.parser(options);
  const auto all = std::make_move_iterator(dataset.records.begin());
  for (std::size_t first = 0; first < dataset.records.size(); first += kRecordsAtOnce) {
    const std::size_t end = std::min(first + kRecordsAtOnce, dataset.records.size());
    take({all + static_cast<std::ptrdiff_t>(first), all + static_cast<std::ptrdiff_t>(end)});
  }
  dataset.records = {};
  return dataset;
}

Loading::Loading(const DatasetOptions& dataset_options, const std::filesystem::path& default_images)
    : options(dataset_options),
      file(dataset_options.root / dataset_options.annotations),
      finder({.root = dataset_options.root,
              .images = dataset_options.images,
              .default_images = default_images,
              .annotations = dataset_options.annotations.parent_path()}) {}

void set_found_picture(Loading& loading, RecordReader& reader, const PictureName& name,
                       const FoundPicture& found, const std::string& annotation, SampleRecord& sample) {
  sample.dataset = loading.options.name;
  sample.split = loading.options.split;
  const std::string valid_name = manifests::valid_utf8(name.name);
  sample.image_ref = bounded_text(valid_name);
  // Bytes are written out with backslashes, which id_part() would take for ends of folders.
  const std::string picture = bounded_text(manifests::valid_utf8(id_part(bounded_text(name.name))));
  sample.id = fmt::format("{}/{}/{}#{}", sample.dataset, sample.split, picture, bounded_text(annotation));
  if (reader.failed()) return;
  if (!manifests::is_utf8(name.name)) {
    reader.fail(Reason::record_malformed, name.field,
                fmt::format("\"{}\", a name with bytes that are no UTF-8", sample.image_ref),
                "a name in the encoding UTF-8; rename the picture or its folder");
    return;
  }
  if (found.failure == Reason::none) {
    sample.image_path = found.path.string();
  } else {
    reader.fail(found.failure, name.field, found.got, "a picture below the dataset's root");
  }
}

void set_picture(Loading& loading, RecordReader& reader, const std::vector<PictureName>& names,
                 const std::string& annotation, SampleRecord& sample) {
  FoundPicture first;
  for (std::size_t i = 0; i < names.size() && !reader.failed(); ++i) {
    FoundPicture found = loading.finder.find(names[i].name);
    if (found.failure == Reason::none) {
      set_found_picture(loading, reader, names.front(), found, annotation, sample);
      return;
    }
    if (i == 0) first = std::move(found);
  }
  set_found_picture(loading, reader, names.front(), first, annotation, sample);
}

void note_placeholders(Loading& loading, std::span<const manifests::Keypoint> keypoints,
                       const SampleRecord& sample) {
  const bool any = std::any_of(keypoints.begin(), keypoints.end(), [](const manifests::Keypoint& point) {
    return point.v > 0.0F && is_placeholder(point.x_px, point.y_px);
  });
  if (!any) return;
  loading.notes.count(
      "labelled keypoints at (0, 0) or (-1, -1), where tools put points that nobody set, get weight 0",
      sample.id, NoteKind::caution);
}

void note_made_box(Loading& loading, double margin, const SampleRecord& sample) {
  loading.notes.count(
      fmt::format("no box: it was made around the keypoints, with a margin of {} of its longer side", margin),
      sample.id);
}

manifests::Box read_or_make_box(Loading& loading, RecordReader& reader, const std::string& field,
                                std::span<const manifests::Keypoint> keypoints, const SampleRecord& sample) {
  const double margin = loading.options.box_margin;
  const auto made = reader.has_box(field) ? std::nullopt : pictures::box_around(keypoints, margin);
  if (!made) return reader.box(field);
  note_made_box(loading, margin, sample);
  return *made;
}

void check_box(RecordReader& reader, const std::string& field, const SampleRecord& sample) {
  if (reader.failed()) return;
  if (const auto problem = pictures::find_box_problem(sample.box, sample.width_px, sample.height_px)) {
    reader.fail(problem->reason, field, problem->got, problem->expected);
  }
}

void check_visible(RecordReader& reader, const std::string& field, const SampleRecord& sample) {
  const bool any = std::any_of(sample.keypoints.begin(), sample.keypoints.end(),
                               [](const manifests::Keypoint& point) { return point.weight > 0.0F; });
  if (any) return;
  reader.fail(Reason::no_visible_keypoints, field, "v <= 0 throughout the 26", "a labelled keypoint");
}

void set_family(Loading& loading, std::optional<Family> stated, std::optional<Family> from_table,
                SampleRecord& sample) {
  sample.species = bounded_text(std::move(sample.species));
  sample.family = stated ? *stated : from_table.value_or(Family::none);
  if (stated && from_table && *stated != *from_table) {
    loading.notes.count(
        fmt::format(
            "species \"{}\" is {} in the file and {} in the species table (the file's family is used)",
            sample.species, manifests::to_string(*stated), manifests::to_string(*from_table)),
        sample.id);
  }
  if (!stated && !from_table && !sample.species.empty()) {
    loading.notes.count(
        fmt::format("species \"{}\" is not in the species table, so it has no family", sample.species),
        sample.id);
  }
}

void bound_texts(std::vector<SampleRecord>& records) {
  for (SampleRecord& record : records) {
    for (std::string* text : {&record.species, &record.source, &record.failure_detail}) {
      *text = bounded_text(std::move(*text));
    }
  }
}

Dataset finished(Loading& loading, std::vector<SampleRecord> records) {
  bound_texts(records);
  const auto note = [&](const char* text, std::size_t count, NoteKind kind = NoteKind::remark) {
    if (count > 0) loading.notes.add(fmt::format("{}: {}", text, count), kind);
  };
  const PictureFinder& finder = loading.finder;
  note("pictures whose name leads to another disk or server, found by the last parts of the name",
       finder.found_by_tail());
  note("of these, names that lead to the same file as an earlier name (one of them must be wrong)",
       finder.shared_files(), NoteKind::caution);
  note(
      "picture names that are not paths below the root as they stand (backslashes, %20, \"..\", the root's "
      "own name)",
      finder.found_by_reading());
  note("picture names that differ from the name of the file in letter case, accents, '+' or .jpeg",
       finder.found_by_spelling());
  std::vector<std::filesystem::path> files{loading.file};
  std::copy_if(loading.more_files.begin(), loading.more_files.end(), std::back_inserter(files),
               [](const std::filesystem::path& file) { return !keypoints::is_builtin_topology(file); });
  return {std::move(records), valid_notes(loading.notes), std::move(files)};
}

}  // namespace q3d::loaders::formats
