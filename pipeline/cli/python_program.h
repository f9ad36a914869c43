// The part of the program that is written in Python: the package python/quadruped3d.
#pragma once

#include <string>
#include <vector>

namespace q3d::pipeline::cli {

// Says whether this interpreter can import the module, and the interpreter's output if it cannot.
struct PythonCheck {
  bool has_module = false;
  std::string message;
};
PythonCheck check_python(const std::string& python, const std::string& module);

// Replaces this process by `python -m module words...`. Returns an exit code only if that fails, after saying
// why on stderr.
int become_python(const std::string& python, const std::string& module,
                  const std::vector<std::string>& words);

}  // namespace q3d::pipeline::cli
