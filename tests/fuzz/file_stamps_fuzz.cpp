// The stamps of a build's inputs: what is read and written again is the same.
#include "pipeline/build/file_stamps.h"

#include <optional>

#include "manifests/next_field.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using Files = std::vector<q3d::pipeline::build::StampedFile>;

// Nothing if a line is no line of a record.
std::optional<Files> read(std::string_view text) {
  q3d::pipeline::build::StampReader reader;
  Files files;
  while (!text.empty()) {
    if (!reader.read(q3d::manifests::next_field(text, '\n'), files)) return std::nullopt;
  }
  return files;
}

std::string write(const Files& files) {
  std::string text;
  q3d::fuzz::require(q3d::pipeline::build::StampWriter().append(files, text), "no path holds a line feed");
  return text;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::optional<Files> files = read(q3d::fuzz::as_text(data, size));
  if (!files) return 0;
  const std::string written = write(*files);
  const std::optional<Files> again = read(written);
  q3d::fuzz::require(again && write(*again) == written, "stamps survive being written", written);
  return 0;
}
