// Pictures and masks are digested when the candidates are read, and decoded later.
#pragma once

#include <string>

#include "manifests/sample.h"

namespace q3d::pipeline::candidates {

// A decoded file and what was found out about it.
struct DecodedFile {
  const std::string& path;
  const std::string& sha256;  // of the bytes that were decoded; empty if they were not read
  manifests::Reason failure;
  const std::string& detail;  // text of the failure
};

// Throws std::runtime_error if the decoded file is not the one that was digested, so that provenance never
// names other bytes than those that were used. The file may be gone (an unmounted disk), replaced or damaged;
// this is no failure of a sample. `expected` is the earlier SHA-256, empty if there was no file.
void require_as_digested(const DecodedFile& file, const std::string& expected);

}  // namespace q3d::pipeline::candidates
