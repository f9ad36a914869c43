#include "pipeline/candidates/veto.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::candidates {
namespace {

std::string read_text(const std::filesystem::path& file) {
  try {
    return manifests::read_file(file);
  } catch (const manifests::IoError& error) {
    if (!error.names_no_file()) throw;
    throw run::ConfigError(fmt::format("veto: {}", error.what()));
  }
}

}  // namespace

Veto read_veto(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  Veto veto;
  veto.sha256 = manifests::sha256(text);
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty() || line.starts_with('#')) continue;
    const std::size_t tab = line.find('\t');
    const std::string id = line.substr(0, tab);
    // dataset/split/image#annotation
    if (std::count(id.begin(), id.end(), '/') < 2 || id.find('#') == std::string::npos) {
      throw run::ConfigError(
          fmt::format("{}: line {}: got \"{}\", expected a sample id as in verdicts.csv, such as "
                      "superanimal/train/images/wolf_1.jpg#12",
                      file.string(), number, id));
    }
    const std::string why = tab == std::string::npos ? "" : line.substr(tab + 1);
    veto.reasons[id] = why.empty() ? "by the user" : why;
  }
  return veto;
}

}  // namespace q3d::pipeline::candidates
