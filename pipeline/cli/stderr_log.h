// Writes the library's log to stderr.
#pragma once

#include "pipeline/run/log.h"

namespace q3d::pipeline::cli {

// Writes "LINE", "note: LINE" or "warning: LINE". On a terminal it first clears the progress line, which is
// drawn again below. Control characters are escaped, so a line stays one line.
class StderrLog : public run::LogSink {
 public:
  void write(run::LogLevel level, std::string_view line) override;
};

}  // namespace q3d::pipeline::cli
