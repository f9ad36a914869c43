#include "pipeline/candidates/list_file.h"

#include <fmt/format.h>

#include <sstream>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::candidates {
namespace {

std::string read_text(const std::filesystem::path& file, std::string_view what) {
  try {
    return manifests::read_file(file);
  } catch (const manifests::IoError& error) {
    if (!error.names_no_file()) throw;
    throw run::ConfigError(fmt::format("{}: {}", what, error.what()));
  }
}

}  // namespace

ListFile read_list_file(const std::filesystem::path& file, std::string_view what) {
  const std::string text = read_text(file, what);
  ListFile list{manifests::sha256(text), {}};
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty() || line.starts_with('#')) continue;
    list.lines.push_back({number, line});
  }
  return list;
}

}  // namespace q3d::pipeline::candidates
