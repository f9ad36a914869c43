#include "tests/pipeline/dataset/made_dataset.h"

#include <nlohmann/json.hpp>

#include <limits>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/sealed_json.h"
#include "manifests/shard.h"

namespace q3d::pipeline::dataset {
namespace {

namespace fs = std::filesystem;
using manifests::ShardSample;
using nlohmann::json;

// A sample of keypoints alone, whose body is not there.
ShardSample flat_sample(const std::string& id) {
  ShardSample sample;
  sample.record.id = id;
  sample.record.dataset = "zoo";
  sample.record.split = "train";
  sample.record.species = "wolf";
  sample.record.family = manifests::Family::canidae;
  sample.record.image_ref = "p.jpg";
  sample.record.box = {1.0, 2.0, 30.0, 40.0};
  sample.record.keypoints[3] = {5.0, 6.0, 2.0F, 1.0F};
  sample.label_kind = manifests::LabelKind::two_d_only;
  sample.judgement.verdict = manifests::Verdict::retained;
  sample.image_width_px = 64;
  sample.image_height_px = 48;
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  sample.body.camera = {kNaN, kNaN, kNaN};
  sample.projected_2d.fill({kNaN, kNaN});
  return sample;
}

json counts(int candidates, int retained, int discarded, int failed) {
  return {{"candidates", candidates},
          {"retained", retained},
          {"refined", 0},
          {"discarded", discarded},
          {"failed", failed}};
}

json write_shards(const fs::path& folder, std::string& digests) {
  json list = json::array();
  for (const int unit : {0, 1}) {
    const std::string name = "shards/00000" + std::to_string(unit) + ".h5";
    const fs::path file = folder / name;
    const std::string id = unit == 0 ? "zoo/train/a.jpg#0" : "zoo/train/d.jpg#3";
    const std::string digest = manifests::write_shard(file,
                                                      {.dataset = "made",
                                                       .version = "1.0.0",
                                                       .unit = unit,
                                                       .image_encoding = manifests::ImageEncoding::reference},
                                                      {flat_sample(id)});
    digests += digest + '\n';
    list.push_back(
        {{"file", name}, {"unit", unit}, {"rows", 1}, {"bytes", fs::file_size(file)}, {"sha256", digest}});
  }
  return list;
}

}  // namespace

const char* const kVerdicts =
    "id,verdict,reason,initial_error,final_error,gain,iterations,best_iteration,dataset,split,source,species,"
    "family,shard,row,image_sha256,detail\n"
    "zoo/train/a.jpg#0,retained,none,,,,,,zoo,train,,wolf,canidae,0,0,aa,\n"
    "zoo/train/b.jpg#1,failed,image_empty,,,,,,zoo,train,,wolf,canidae,,,,\"got 0 bytes, expected a "
    "picture\"\n"
    "pool/test/c.jpg#2,discarded,error_too_large,0.09,0.09,,0,0,pool,test,web,cow,bovidae,,,cc,\n"
    "zoo/train/d.jpg#3,retained,none,,,,,,zoo,train,,,none,1,0,dd,\n";

fs::path make_dataset(const fs::path& folder) {
  const fs::path version = folder / "made-0123456789ab";
  fs::create_directories(version / "shards");
  std::string digests;
  json document = {{"format", "quadruped3d-dataset"},
                   {"schema", 2},
                   {"name", "made"},
                   {"version", "1.0.0"},
                   {"toolkit", "0.2.0"},
                   {"profile", "paper"},
                   {"counts", counts(4, 2, 1, 1)}};
  document["key"] = "0123456789ab" + std::string(52, '0');
  document["shards"] = write_shards(version, digests);
  document["content_id"] = manifests::sha256(digests);
  document["labels"] = {{"truth", 0}, {"retained", 0}, {"refined", 0}, {"2d_only", 2}};
  document["datasets"] = {
      {"zoo/train",
       {{"licence", "CC-BY-4.0"}, {"source_url", "https://example.org/zoo"}, {"citation", "A zoo"}}},
      {"pool/test", {{"licence", ""}, {"source_url", ""}, {"citation", ""}}}};
  document["thresholds"] = {{"pool", {{"tau_low", 0.04}, {"tau_high", 0.08}, {"delta", 0.05}}}};
  document["statistics"] = {
      {"all", counts(4, 2, 1, 1)},
      {"reasons", {{"error_too_large", 1}, {"image_empty", 1}}},
      {"by_dataset", {{"zoo/train", counts(3, 2, 0, 1)}, {"pool/test", counts(1, 0, 1, 0)}}},
      {"by_family",
       {{"canidae", counts(2, 1, 0, 1)}, {"bovidae", counts(1, 0, 1, 0)}, {"none", counts(1, 1, 0, 0)}}},
      {"by_species",
       {{"wolf", counts(2, 1, 0, 1)}, {"cow", counts(1, 0, 1, 0)}, {"unknown", counts(1, 1, 0, 0)}}}};
  document["provenance"] = {
      {"config",
       {{"datasets", {{{"name", "zoo"}, {"role", "2d_only"}}, {{"name", "pool"}, {"split", "test"}}}},
        {"shards", {{"unit_size", 2}}}}},
      {"checkpoint_sha256", std::string(64, 'c')},
      {"smal_asset_sha256", std::string(64, 'd')},
      {"device", "cpu"},
      {"stage_keys",
       {{"ingest", "i"},
        {"predict", std::string(64, '1')},
        {"fidelity", "f"},
        {"refine", std::string(64, '2')},
        {"measure", nullptr},
        {"shards", "s"}}}};
  document["verdicts"] = {{"file", "verdicts.csv"}, {"sha256", manifests::sha256(kVerdicts)}};
  manifests::write_file_atomically(version / "verdicts.csv", std::string_view(kVerdicts));
  manifests::write_file_atomically(version / "dataset.json", manifests::seal_json(document));
  fs::create_directory_symlink(version.filename(), folder / "latest");
  return version;
}

}  // namespace q3d::pipeline::dataset
