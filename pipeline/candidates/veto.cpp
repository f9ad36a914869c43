#include "pipeline/candidates/veto.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/candidates/list_file.h"
#include "pipeline/run/errors.h"

namespace q3d::pipeline::candidates {

Veto read_veto(const std::filesystem::path& file) {
  const ListFile list = read_list_file(file, "veto");
  Veto veto;
  veto.sha256 = list.sha256;
  for (const auto& [number, line] : list.lines) {
    const std::size_t tab = line.find('\t');
    const std::string id = line.substr(0, tab);
    // A sample id has the form dataset/split/image#annotation.
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
