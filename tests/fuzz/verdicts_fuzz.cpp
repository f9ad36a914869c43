// verdicts.csv, and CSV itself: cells that are written are read again as they were.
#include <vector>

#include "manifests/csv.h"
#include "manifests/verdict.h"
#include "pipeline/dataset/verdicts.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;

void read_verdicts(const std::filesystem::path& file) {
  q3d::fuzz::value_or_refusal(file, [&] {
    q3d::pipeline::dataset::VerdictReader reader(file);
    std::size_t position = 0;
    while (const auto row = reader.next()) {
      require(row->position == position++, "rows are counted");
      const bool is_kept = row->judgement.reason == q3d::manifests::Reason::none;
      require(row->label.has_value() == is_kept, "a kept candidate has a place in a shard", row->id);
      require(!row->label || (row->label->shard >= 0 && row->label->row >= 0), "places count from 0",
              row->id);
      require(row->judgement.iterations >= 0 && row->judgement.best_iteration >= 0, "steps are counted",
              row->id);
    }
  });
}

void read_cells(const std::filesystem::path& file, std::string_view text) {
  q3d::fuzz::value_or_refusal(file, [&] {
    q3d::manifests::CsvReader reader(text, file.string());
    q3d::manifests::CsvRow cells;
    while (reader.next(cells)) {
      const std::string line = q3d::manifests::csv_line(cells);
      q3d::manifests::CsvReader again(line, file.string());
      q3d::manifests::CsvRow back;
      require(again.next(back) && back == cells && !again.next(back), "a line survives being written", line);
    }
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const q3d::fuzz::Scratch scratch;
  const std::string_view text = q3d::fuzz::as_text(data, size);
  const auto file = scratch.write("verdicts.csv", text);
  read_verdicts(file);
  read_cells(file, text);
  return 0;
}
