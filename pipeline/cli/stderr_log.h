// The library's log on stderr.
#pragma once

#include "pipeline/run/log.h"

namespace q3d::pipeline::cli {

// Writes "LINE", "note: LINE" or "warning: LINE". On a terminal it first clears the progress line, which
// draws itself again below. A line stays one line, whatever is in it.
class StderrLog : public run::LogSink {
 public:
  void write(run::LogLevel level, std::string_view line) override;
};

}  // namespace q3d::pipeline::cli
