// Column names in a pickle, read as data.
#include "loaders/formats/pickled_names.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  q3d::fuzz::value_or_refusal("names", [&] {
    for (const auto& names :
         q3d::loaders::formats::read_pickled_columns(q3d::fuzz::as_text(data, size), "names")) {
      q3d::fuzz::require(names.size() <= 8, "a column has a few names");
    }
  });
  return 0;
}
