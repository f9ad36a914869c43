// Reads verdicts.csv of a published dataset row by row. It has the verdict on every candidate.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/csv.h"
#include "manifests/verdict.h"

namespace q3d::pipeline::dataset {

struct VerdictRow {
  struct LabelPlace {
    std::int64_t shard = 0;  // number of the unit, and so of the shard
    std::int64_t row = 0;    // in that shard, from 0
  };

  std::string id;
  std::size_t position = 0;  // in ingest order, from 0
  manifests::Judgement judgement;
  std::string dataset;
  std::string split;
  std::string source;
  std::string species;
  manifests::Family family = manifests::Family::none;
  std::optional<LabelPlace> label;  // set if the candidate is kept
  std::string image_sha256;

  // Returns whether the fidelity rule saw a prediction of the candidate, so that initial_error is a number.
  bool is_judged() const;
};

class VerdictReader {
 public:
  // Reads the file. Throws std::runtime_error that names it if it cannot be read or lacks a column.
  explicit VerdictReader(const std::filesystem::path& file);
  ~VerdictReader() = default;
  VerdictReader(const VerdictReader&) = delete;
  VerdictReader& operator=(const VerdictReader&) = delete;

  // Returns the next candidate, or nothing at the end. Throws std::runtime_error that names file and line for
  // a name that is no enumerator's, for a cell that is no number, and for a row that contradicts itself: a
  // kept candidate has a row in a shard and no reason, every other has a reason and no row.
  std::optional<VerdictRow> next();

 private:
  struct Columns {
    std::size_t id = 0, verdict = 0, reason = 0, initial_error = 0, final_error = 0, gain = 0;
    std::size_t iterations = 0, best_iteration = 0, dataset = 0, split = 0, source = 0, species = 0;
    std::size_t family = 0, shard = 0, row = 0, image_sha256 = 0, detail = 0;
    std::array<std::optional<std::size_t>, manifests::kTrustColumns.size()>
        trust{};  // absent before schema 2
  };
  static Columns find_columns(const manifests::CsvTableReader& table);
  std::optional<std::int64_t> whole(std::size_t column, double most) const;
  VerdictRow parse() const;

  std::string text_;
  manifests::CsvTableReader table_;
  Columns at_;
  std::size_t position_ = 0;
};

}  // namespace q3d::pipeline::dataset
