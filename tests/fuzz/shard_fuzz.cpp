// Shards, and the tables that they and the stages' files are.
#include <span>
#include <vector>

#include "manifests/shard.h"
#include "manifests/table.h"
#include "tests/fuzz/fuzz_input.h"

// HDF5 1.10 leaks memory of its own when it refuses a damaged file.
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libhdf5";
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using q3d::fuzz::require;
  static const q3d::fuzz::Scratch scratch;
  const auto file = scratch.write("shard.h5", q3d::fuzz::as_text(data, size));
  // Bytes in memory are read in this process, so that the sanitizers see it; a file on disk is tried in a
  // process of its own first.
  q3d::fuzz::value_or_refusal(file, [&] {
    const auto bytes = std::as_bytes(std::span(data, size));
    const q3d::manifests::Table table =
        q3d::manifests::read_table(file, std::vector<std::byte>(bytes.begin(), bytes.end()));
    require(table.rows >= 0, "a table has rows");
    for (const auto& [name, values] : table.text) {
      require(static_cast<std::int64_t>(values.size()) == table.rows, "a column has every row", name);
    }
  });
  q3d::fuzz::value_or_refusal(file, [&] {
    for (const auto& sample : q3d::manifests::read_shard(file).samples) {
      require(!sample.record.id.empty(), "a sample has an id");
    }
  });
  return 0;
}
