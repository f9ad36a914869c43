#include "pipeline/dataset/verdicts.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/enumerators.h"

namespace q3d::pipeline::dataset {
namespace {

constexpr double kMostExact = 0x1.0p53;  // the doubles up to here hold every whole number
constexpr double kMostSteps = std::numeric_limits<int>::max();

}  // namespace

bool VerdictRow::is_judged() const {
  return !std::isnan(judgement.initial_error);
}

VerdictReader::VerdictReader(const std::filesystem::path& file)
    : text_(manifests::read_file(file)), table_(text_, file.string()), at_(find_columns(table_)) {}

VerdictReader::Columns VerdictReader::find_columns(const manifests::CsvTableReader& table) {
  const auto at = [&](const char* name) { return table.column(name); };
  std::array<std::optional<std::size_t>, manifests::kTrustColumns.size()> trust{};
  for (std::size_t i = 0; i < trust.size(); ++i) {
    trust[i] = table.find_column(manifests::kTrustColumns[i].name);
  }
  return {.id = at("id"),
          .verdict = at("verdict"),
          .reason = at("reason"),
          .initial_error = at("initial_error"),
          .final_error = at("final_error"),
          .gain = at("gain"),
          .iterations = at("iterations"),
          .best_iteration = at("best_iteration"),
          .dataset = at("dataset"),
          .split = at("split"),
          .source = at("source"),
          .species = at("species"),
          .family = at("family"),
          .shard = at("shard"),
          .row = at("row"),
          .image_sha256 = at("image_sha256"),
          .detail = at("detail"),
          .trust = trust};
}

std::optional<VerdictRow> VerdictReader::next() {
  if (!table_.next()) return std::nullopt;
  try {
    std::optional<VerdictRow> row = parse();
    ++position_;
    return row;
  } catch (const std::invalid_argument& error) {  // from a name that is no enumerator's
    table_.fail(error.what(), "one of these");
  }
}

std::optional<std::int64_t> VerdictReader::whole(std::size_t column, double most) const {
  const std::optional<double> number = table_.number(column);
  if (!number) return std::nullopt;
  if (!(*number >= 0.0 && *number <= most && std::floor(*number) == *number)) {
    table_.fail("\"" + table_.cell(column) + "\"", fmt::format("a whole number from 0 to {}", most));
  }
  return static_cast<std::int64_t>(*number);
}

VerdictRow VerdictReader::parse() const {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  VerdictRow row;
  row.id = table_.cell(at_.id);
  row.position = position_;
  row.judgement.verdict = manifests::verdict_from_string(table_.cell(at_.verdict));
  row.judgement.reason = manifests::reason_from_string(table_.cell(at_.reason));
  row.judgement.detail = table_.cell(at_.detail);
  row.judgement.initial_error = table_.number(at_.initial_error).value_or(kNaN);
  row.judgement.final_error = table_.number(at_.final_error).value_or(kNaN);
  row.judgement.gain = table_.number(at_.gain).value_or(kNaN);
  row.judgement.iterations = static_cast<int>(whole(at_.iterations, kMostSteps).value_or(0));
  row.judgement.best_iteration = static_cast<int>(whole(at_.best_iteration, kMostSteps).value_or(0));
  for (std::size_t i = 0; i < at_.trust.size(); ++i) {
    if (!at_.trust[i]) continue;
    row.judgement.trust.*manifests::kTrustColumns[i].score = table_.number(*at_.trust[i]).value_or(kNaN);
  }
  row.dataset = table_.cell(at_.dataset);
  row.split = table_.cell(at_.split);
  row.source = table_.cell(at_.source);
  row.species = table_.cell(at_.species);
  row.family = manifests::family_from_string(table_.cell(at_.family));
  row.image_sha256 = table_.cell(at_.image_sha256);
  const auto shard = whole(at_.shard, kMostExact);
  const auto place = whole(at_.row, kMostExact);
  if (shard && place) row.label = VerdictRow::LabelPlace{*shard, *place};

  const bool is_kept = manifests::is_kept(row.judgement.verdict);
  if (shard.has_value() != is_kept || place.has_value() != is_kept) {
    table_.fail(row.label ? "a row in a shard" : "no row in a shard",
                "one for the verdicts retained and refined, and for no other");
  }
  if ((row.judgement.reason == manifests::Reason::none) != is_kept) {
    table_.fail("the reason " + table_.cell(at_.reason),
                "\"none\" for the verdicts retained and refined, and for no other");
  }
  return row;
}

}  // namespace q3d::pipeline::dataset
