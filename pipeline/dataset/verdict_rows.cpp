#include "pipeline/dataset/verdict_rows.h"

#include <fmt/format.h>

#include <cmath>

#include "manifests/csv.h"
#include "manifests/enumerators.h"
#include "manifests/trust.h"

namespace q3d::pipeline::dataset {
namespace {

using manifests::csv_cell;

// Returns the shortest text that reads back as the same number; empty for NaN.
std::string number(double value) {
  return std::isnan(value) ? std::string() : fmt::format("{}", value);
}

// Returns the cells of the trust scores, each after its comma.
std::string trust_cells(const manifests::TrustScores& trust) {
  std::string cells;
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) {
    cells += "," + number(trust.*column.score);
  }
  return cells;
}

}  // namespace

std::string verdict_header() {
  std::string text = "id,verdict,reason,initial_error,final_error,gain,iterations,best_iteration";
  for (const manifests::TrustColumn& column : manifests::kTrustColumns) text.append(",").append(column.name);
  return text + ",dataset,split,source,species,family,shard,row,image_sha256,detail\n";
}

std::string verdict_row(const candidates::Candidate& candidate, const manifests::Judgement& judgement,
                        std::int64_t unit, std::int64_t row) {
  const manifests::SampleRecord& record = candidate.record;
  const bool kept = manifests::is_kept(judgement.verdict);
  const bool judged = !std::isnan(judgement.initial_error);
  return fmt::format("{},{},{},{},{},{},{},{}{},{},{},{},{},{},{},{},{},{}\n", csv_cell(record.id),
                     manifests::to_string(judgement.verdict), manifests::to_string(judgement.reason),
                     number(judgement.initial_error), number(judgement.final_error), number(judgement.gain),
                     judged ? std::to_string(judgement.iterations) : "",
                     judged ? std::to_string(judgement.best_iteration) : "", trust_cells(judgement.trust),
                     csv_cell(record.dataset), csv_cell(record.split), csv_cell(record.source),
                     csv_cell(record.species), manifests::to_string(record.family),
                     kept ? std::to_string(unit) : "", kept ? std::to_string(row) : "",
                     candidate.image_sha256, csv_cell(judgement.detail));
}

}  // namespace q3d::pipeline::dataset
