// The stamps of a build's inputs: what is read and written again is the same.
#include "pipeline/build/file_stamps.h"

#include <stdexcept>

#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using q3d::fuzz::require;
  try {
    const auto files = q3d::pipeline::build::stamps_from_text(q3d::fuzz::as_text(data, size));
    const auto written = q3d::pipeline::build::to_text(files);
    require(written.has_value(), "no path holds a line feed");
    const auto again = q3d::pipeline::build::to_text(q3d::pipeline::build::stamps_from_text(*written));
    require(again == written, "stamps survive being written", *written);
  } catch (const std::invalid_argument& error) {
    require(std::string_view(error.what()).find("stamp") != std::string_view::npos, "a refusal says of what",
            error.what());
  }
  return 0;
}
