#include "pipeline/training/training_log.h"

#include <fcntl.h>

#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "manifests/atomic_file.h"
#include "manifests/json_number.h"
#include "manifests/json_parse.h"

namespace q3d::pipeline::training {
namespace {

// Returns whether the line is a log line up to this position. A half line of a killed process is not, nor is
// any other text.
bool is_at_or_before(const std::string& line, int phase, std::int64_t step) {
  const nlohmann::json document = manifests::parse_json_or_null<nlohmann::json>(line);
  if (!document.is_object()) return false;
  try {
    const std::int64_t line_phase = manifests::whole_number_at(document, "phase");
    return line_phase < phase ||
           (line_phase == phase && manifests::whole_number_at(document, "step") <= step);
  } catch (const nlohmann::json::exception&) {
    return false;
  } catch (const std::runtime_error&) {
    return false;
  }
}

}  // namespace

TrainingLog::TrainingLog(std::filesystem::path path, int phase, std::int64_t step) : path_(std::move(path)) {
  std::string kept;
  if (std::filesystem::exists(path_)) {
    std::istringstream lines(manifests::read_file(path_));
    for (std::string line; std::getline(lines, line);) {
      if (is_at_or_before(line, phase, step)) kept += line + "\n";
    }
  }
  manifests::write_file_atomically(path_, kept);
  file_ = manifests::FileDescriptor(path_, O_WRONLY | O_APPEND);
}

void TrainingLog::write(const LogLine& line) {
  nlohmann::ordered_json terms = nlohmann::ordered_json::object();
  for (const auto& [name, value] : line.terms) terms[name] = value;
  const nlohmann::ordered_json document = {{"phase", line.phase},
                                           {"phase_name", line.phase_name},
                                           {"step", line.step},
                                           {"loss", line.loss},
                                           {"terms", terms},
                                           {"gradient_norm", line.gradient_norm},
                                           {"learning_rate", line.learning_rate},
                                           {"samples_per_second", line.samples_per_second},
                                           {"seconds", line.seconds}};
  const std::string text = document.dump() + "\n";
  file_.write_all(text);
}

void TrainingLog::sync() const {
  file_.sync();
}

}  // namespace q3d::pipeline::training
