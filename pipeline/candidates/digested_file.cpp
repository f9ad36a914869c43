#include "pipeline/candidates/digested_file.h"

#include <fmt/format.h>

#include <stdexcept>

namespace q3d::pipeline::candidates {

void require_as_digested(const DecodedFile& file, const std::string& expected) {
  if (!expected.empty() && file.failure == manifests::Reason::image_missing) {
    throw std::runtime_error(
        fmt::format("{}: it could be read before and cannot now ({}); put it back and run again", file.path,
                    file.detail));
  }
  if (file.sha256.empty() || file.sha256 == expected) return;
  throw std::runtime_error(fmt::format(
      "{}: it was replaced or damaged: its SHA-256 is {}, and {} when the candidates were read. Put the "
      "earlier file back; if the present one is right, remove digests.txt from the output folder. Then run "
      "again",
      file.path, file.sha256, expected.empty() ? "there was no file" : "was " + expected));
}

}  // namespace q3d::pipeline::candidates
