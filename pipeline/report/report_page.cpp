#include "pipeline/report/report_page.h"

#include <array>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "pipeline/report/embedded_files.h"

namespace q3d::pipeline::report {

std::string script_json(const nlohmann::ordered_json& document) {
  const std::string json = document.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string text;
  text.reserve(json.size());
  for (const char c : json) {
    // "</script" and "<!--" begin with '<'. In JSON it occurs only inside texts, where the escape means the
    // same.
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  return text;
}

std::string report_html(const nlohmann::ordered_json& statistics, const nlohmann::ordered_json& pictures) {
  const std::string scripts =
      std::string(page_charts()) + std::string(page_explorer()) + std::string(page_further_charts());
  const std::array<std::pair<std::string_view, std::string>, 5> parts{
      {{"@STYLE@", std::string(page_style())},
       {"@STATISTICS@", script_json(statistics)},
       {"@PICTURES@", script_json(pictures)},
       {"@PLOTLY@", std::string(plotly_script())},
       {"@SCRIPT@", scripts}}};
  // The template is scanned once, so that marks inside an inserted part are not replaced.
  std::string page;
  std::string_view rest = page_template();
  for (const auto& [mark, text] : parts) {
    const std::size_t at = rest.find(mark);
    if (at == std::string_view::npos) {
      throw std::logic_error("report.html lacks the mark " + std::string(mark) + ", or has it too early");
    }
    page += rest.substr(0, at);
    page += text;
    rest.remove_prefix(at + mark.size());
  }
  page += rest;
  return page;
}

}  // namespace q3d::pipeline::report
