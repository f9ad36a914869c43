#include "tests/pipeline/exports/body_dataset.h"

#include <fmt/format.h>

#include <map>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/sealed_json.h"
#include "manifests/trust.h"
#include "tests/pipeline/exports/body_samples.h"

namespace q3d::testing {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int kRows = 4;

json counts(std::int64_t kept, std::int64_t discarded) {
  return {{"candidates", kept + discarded},
          {"retained", kept},
          {"refined", 0},
          {"discarded", discarded},
          {"failed", 0}};
}

std::string verdicts_header() {
  std::string text = "id,verdict,reason,initial_error,final_error,gain,iterations,best_iteration";
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) text.append(",").append(column.name);
  return text + ",dataset,split,source,species,family,shard,row,image_sha256,detail\n";
}

std::string verdict_line(const std::string& id, const char* verdict, const char* reason, double error,
                         const std::string& species, const std::string& place, const std::string& image) {
  const std::string no_trust(manifests::kTrustColumns.size(), ',');
  return fmt::format("{},{},{},{},{},,0,0{},zoo,train,,{},canidae,{},{},\n", id, verdict, reason, error,
                     error, no_trust, species, place, image);
}

// The parts of dataset.json that do not depend on the samples.
json empty_document(const std::string& name) {
  json document = {
      {"format", "quadruped3d-dataset"}, {"schema", 2},        {"name", name},      {"version", "1.0.0"},
      {"key", manifests::sha256(name)},  {"toolkit", "0.2.0"}, {"profile", "paper"}};
  document["datasets"]["zoo/train"] = {{"format", "prima"},
                                       {"role", "pseudo"},
                                       {"licence", "CC-BY-4.0"},
                                       {"source_url", "https://example.org/zoo"},
                                       {"citation", "A zoo"}};
  document["thresholds"]["zoo"] = {{"tau_low", 0.05}, {"tau_high", 0.1}, {"delta", 0.05}};
  document["provenance"] = {{"config", {{"datasets", json::array({{{"name", "zoo"}}})}}},
                            {"annotations", {{"zoo/train", "a"}}},
                            {"checkpoint_sha256", std::string(64, 'c')},
                            {"smal_asset_sha256", nullptr},
                            {"priors_sha256", nullptr},
                            {"device", "cpu"},
                            {"stage_keys",
                             {{"ingest", "i"},
                              {"predict", "p"},
                              {"fidelity", "f"},
                              {"refine", "r"},
                              {"measure", nullptr},
                              {"shards", "s"}}}};
  return document;
}

}  // namespace

void BodyDataset::write_document() const {
  manifests::write_file_atomically(folder / "dataset.json", manifests::seal_json(document));
}

BodyDataset make_body_dataset(const fs::path& out, const std::string& name,
                              const std::vector<std::string>& shards, unsigned seed) {
  BodyDataset dataset{out / (name + "-000000000000"), empty_document(name), {}};
  fs::create_directories(dataset.folder / "shards");
  std::string verdicts = verdicts_header();
  std::string digests;
  std::map<std::string, std::int64_t> species;
  json& entries = dataset.document["shards"] = json::array();
  for (std::size_t unit = 0; unit < shards.size(); ++unit) {
    const std::string file = fmt::format("shards/{:06}.h5", unit);
    write_body_shard(dataset.folder / file, shards[unit], kRows, seed + 20 * static_cast<unsigned>(unit),
                     static_cast<std::int64_t>(unit));
    const std::string digest = manifests::sha256_file(dataset.folder / file);
    digests += digest + "\n";
    entries.push_back({{"file", file},
                       {"unit", unit},
                       {"rows", kRows},
                       {"bytes", fs::file_size(dataset.folder / file)},
                       {"sha256", digest}});
    int row = 0;
    for (manifests::ShardSample& sample : manifests::read_shard(dataset.folder / file).samples) {
      ++species[sample.record.species];
      verdicts += verdict_line(sample.record.id, "retained", "none", sample.judgement.final_error,
                               sample.record.species, fmt::format("{},{}", unit, row++), sample.image_sha256);
      dataset.samples.push_back(std::move(sample));
    }
  }
  verdicts += verdict_line("zoo/train/" + name + "_bad.jpg#9", "discarded", "error_too_large", 0.25, "wolf",
                           ",", std::string(64, 'b'));
  const auto kept = static_cast<std::int64_t>(dataset.samples.size());
  json& document = dataset.document;
  document["content_id"] = manifests::sha256(digests);
  document["counts"] = counts(kept, 1);
  document["labels"] = {{"truth", 0}, {"retained", kept}, {"refined", 0}, {"2d_only", 0}};
  document["statistics"] = {{"all", counts(kept, 1)},
                            {"reasons", {{"error_too_large", 1}}},
                            {"by_dataset", {{"zoo/train", counts(kept, 1)}}},
                            {"by_family", {{"canidae", counts(kept, 1)}}}};
  for (const auto& [each, count] : species) {
    document["statistics"]["by_species"][each] = counts(count, each == "wolf" ? 1 : 0);
  }
  document["verdicts"] = {{"file", "verdicts.csv"}, {"sha256", manifests::sha256(verdicts)}};
  manifests::write_file_atomically(dataset.folder / "verdicts.csv", verdicts);
  dataset.write_document();
  return dataset;
}

}  // namespace q3d::testing
