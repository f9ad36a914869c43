// Writes COCO keypoints: annotations.json and images/, with a picture for each sample.
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "pipeline/exports/format_writer.h"
#include "pipeline/exports/records.h"

namespace q3d::pipeline::exports {
namespace {

constexpr const char* kFile = "annotations.json";

class CocoWriter final : public FormatWriter {
 public:
  explicit CocoWriter(ExportedDataset dataset) : dataset_(std::move(dataset)) {}

  Pictures pictures() const override { return Pictures::as_stored; }

  std::vector<PictureFile> picture_files(const ExportedSample& exported) const override {
    if (exported.picture.bytes.empty()) return {};
    return {{"images/" + file_name(exported), &exported.picture.bytes}};
  }

  std::string lines(const ExportedSample& exported) const override {
    const std::int64_t id = exported.unit * static_cast<std::int64_t>(dataset_.unit_size) + exported.row + 1;
    const CocoIds ids{id, id, category_of(exported.sample.record.species)};
    return coco_image(exported.sample, exported.picture, file_name(exported), id).dump() + "\n" +
           coco_annotation(exported.sample, exported.picture, ids).dump() + "\n";
  }

  void take(const std::string& lines) override {
    for (std::size_t at = 0; at < lines.size();) {
      const std::size_t middle = lines.find('\n', at);
      const std::size_t end = lines.find('\n', middle + 1);
      images_ += (images_.empty() ? "\n" : ",\n") + lines.substr(at, middle - at);
      annotations_ += (annotations_.empty() ? "\n" : ",\n") + lines.substr(middle + 1, end - middle - 1);
      at = end + 1;
    }
  }

  std::vector<CroissantRecords> assemble(ExportFolder& folder) override {
    nlohmann::ordered_json categories = nlohmann::ordered_json::array();
    for (const auto& [species, family] : dataset_.species) {
      categories.push_back(coco_category(species, family, category_of(species)));
    }
    const nlohmann::ordered_json info = {{"description", dataset_.title},
                                         {"content_id", dataset_.content_id}};
    folder.write(kFile, fmt::format("{{\"info\": {},\n\"categories\": {},\n\"images\": [{}\n],\n"
                                    "\"annotations\": [{}\n]}}\n",
                                    info.dump(), categories.dump(), images_, annotations_));
    const ExportFolder::File& file = folder.files().at(kFile);
    return {{"annotations",
             kFile,
             file.sha256,
             file.bytes,
             "$.annotations[*]",
             {{"id", "id", "cr:Int64", "number of the annotation"},
              {"image_id", "image_id", "cr:Int64", "number of the picture"},
              {"category_id", "category_id", "cr:Int64", "number of the species"},
              {"bbox", "bbox", "cr:Float64", "the animal's box: left, top, width, height (px)", "4"},
              {"keypoints", "keypoints", "cr:Float64", "26 keypoints: x, y (px) and visibility", "78"}}}};
  }

  std::vector<std::string> picture_patterns() const override { return {"images/*." + dataset_.suffix}; }

 private:
  // Returns the name of the exported picture, or that of the source picture if none was exported.
  std::string file_name(const ExportedSample& exported) const {
    if (exported.picture.bytes.empty()) return exported.sample.record.image_ref;
    return picture_stem(exported.sample, exported.unit, exported.row) + "." + dataset_.suffix;
  }

  std::int64_t category_of(const std::string& species) const {
    const auto found = std::find_if(dataset_.species.begin(), dataset_.species.end(),
                                    [&](const auto& each) { return each.first == species; });
    if (found == dataset_.species.end()) throw std::logic_error("CocoWriter: no species " + species);
    return found - dataset_.species.begin() + 1;
  }

  ExportedDataset dataset_;
  std::string images_;       // JSON of the elements
  std::string annotations_;  // JSON of the elements
};

}  // namespace

std::unique_ptr<FormatWriter> make_coco_writer(ExportedDataset dataset) {
  return std::make_unique<CocoWriter>(std::move(dataset));
}

}  // namespace q3d::pipeline::exports
