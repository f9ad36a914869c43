// The build's configuration.
#include "pipeline/config/build_config.h"
#include "pipeline/run/errors.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using q3d::fuzz::require;
  static const q3d::fuzz::Scratch scratch;
  const auto file = scratch.write("config.json", q3d::fuzz::as_text(data, size));
  q3d::fuzz::value_or_refusal<q3d::pipeline::run::ConfigError>(file, [&] {
    const q3d::pipeline::config::BuildConfig config = q3d::pipeline::config::load_build_config({file});
    require(!config.datasets.empty() && config.shards.unit_size > 0, "an accepted config can be built");
    require(!config.as_written.dump().empty(), "an accepted config can be recorded");
  });
  return 0;
}
