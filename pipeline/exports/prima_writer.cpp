// Writes the folder that PRIMA's and AniMer's training reads: <dataset>/<split>.json with its pictures and
// masks.
#include <fmt/format.h>

#include <map>
#include <opencv2/core.hpp>
#include <set>

#include "loaders/pictures/encode.h"
#include "pipeline/exports/format_writer.h"
#include "pipeline/exports/records.h"

namespace q3d::pipeline::exports {
namespace {

// Returns a black mask for samples without one, because the official code opens a mask for every picture. If
// no pixel of the mask reaches one half, it uses the whole crop, as it should here.
std::string blank_mask(int side_px) {
  return fmt::format("masks/none_{}.png", side_px);
}

// Returns a name that can be part of a path: every character that could not is replaced by "-".
std::string path_part(const std::string& name) {
  std::string part = name;
  for (char& c : part) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                          c == '-' || c == '_' || (c == '.' && &c != part.data());
    if (!is_plain) c = '-';
  }
  return part;
}

std::string folder_of(const manifests::ShardSample& sample) {
  return path_part(sample.record.dataset);
}

const std::vector<CroissantField>& croissant_fields() {
  static const std::vector<CroissantField> fields{
      {"id", "id", "sc:Text", "dataset/split/image#annotation"},
      {"img_path", "img_path", "sc:Text", "the picture, relative to the JSON file's folder"},
      {"bbox", "bbox", "cr:Float64", "the animal's box in the picture: left, top, width, height (px)", "4"},
      {"keypoint_2d", "keypoint_2d", "cr:Float64", "annotated keypoints: x, y (px) and visibility", "26,3"},
      {"supercategory", "supercategory", "cr:Int64",
       "family of the SMAL shape space, -1 for none of the five"},
      {"label_kind", "label_kind", "sc:Text", "truth, retained, refined or 2d_only"}};
  return fields;
}

class PrimaWriter final : public FormatWriter {
 public:
  explicit PrimaWriter(ExportedDataset dataset) : dataset_(std::move(dataset)) {}

  Pictures pictures() const override { return Pictures::official; }

  std::vector<PictureFile> picture_files(const ExportedSample& exported) const override {
    if (exported.picture.bytes.empty()) return {};
    const std::string folder = folder_of(exported.sample) + "/";
    const PictureNames names = names_of(exported);
    if (!exported.picture.mask.empty()) {
      return {{folder + names.image, &exported.picture.bytes}, {folder + names.mask, &exported.picture.mask}};
    }
    return {{folder + names.image, &exported.picture.bytes}};
  }

  // A line has three parts with tabs between them: "dataset/split", the side of the blank mask that the
  // record names (empty if it names none), and the record's JSON. take() reads these lines.
  std::string lines(const ExportedSample& exported) const override {
    const PictureNames names = exported.picture.bytes.empty()
                                   ? PictureNames{exported.sample.record.image_ref, {}}
                                   : names_of(exported);
    const bool is_blank = !names.mask.empty() && exported.picture.mask.empty();
    return fmt::format("{}/{}\t{}\t{}\n", folder_of(exported.sample), path_part(exported.sample.record.split),
                       is_blank ? std::to_string(exported.picture.width_px) : "",
                       prima_record(exported.sample, exported.picture, names).dump());
  }

  void take(const std::string& lines) override {
    std::size_t at = 0;
    while (at < lines.size()) {
      const std::size_t first = lines.find('\t', at);
      const std::size_t second = lines.find('\t', first + 1);
      const std::size_t end = lines.find('\n', second + 1);
      const std::string set = lines.substr(at, first - at);
      std::string& records = records_[set];
      records += (records.empty() ? "\n" : ",\n") + lines.substr(second + 1, end - second - 1);
      const std::string blank_side = lines.substr(first + 1, second - first - 1);
      if (!blank_side.empty()) blank_sides_[set.substr(0, set.find('/'))].insert(std::stoi(blank_side));
      at = end + 1;
    }
  }

  std::vector<CroissantRecords> assemble(ExportFolder& folder) override {
    for (const auto& [name, sides] : blank_sides_) {
      for (const int side : sides) {
        const auto png = loaders::pictures::encode_png(cv::Mat(side, side, CV_8UC1, cv::Scalar(0)));
        folder.write_common_picture(name + "/" + blank_mask(side), png);
      }
    }
    std::vector<CroissantRecords> result;
    for (const auto& [set, records] : records_) {
      const std::string file = set + ".json";
      const nlohmann::json info = dataset_.title + ", content id " + dataset_.content_id;
      folder.write(file, fmt::format("{{\"info\": {}, \"data\": [{}\n]}}\n", info.dump(), records));
      result.push_back({path_part(set), file, folder.files().at(file).sha256, folder.files().at(file).bytes,
                        "$.data[*]", croissant_fields()});
    }
    return result;
  }

  std::vector<std::string> picture_patterns() const override {
    return {"*/images/*/*." + dataset_.suffix, "*/masks/*.png"};
  }

 private:
  PictureNames names_of(const ExportedSample& exported) const {
    const std::string split = path_part(exported.sample.record.split);
    const std::string stem = picture_stem(exported.sample, exported.unit, exported.row);
    return {fmt::format("images/{}/{}.{}", split, stem, dataset_.suffix),
            exported.picture.mask.empty() ? blank_mask(exported.picture.width_px)
                                          : fmt::format("masks/{}/{}.png", split, stem)};
  }

  ExportedDataset dataset_;
  std::map<std::string, std::string> records_;        // "dataset/split" -> the records' JSON
  std::map<std::string, std::set<int>> blank_sides_;  // dataset -> sides of its blank masks
};

}  // namespace

std::unique_ptr<FormatWriter> make_prima_writer(ExportedDataset dataset) {
  return std::make_unique<PrimaWriter>(std::move(dataset));
}

}  // namespace q3d::pipeline::exports
