// The files of pipeline/report/page and Plotly, embedded in the program, so that it needs no other file to
// write a page.
#pragma once

#include <string_view>

namespace q3d::pipeline::report {

std::string_view page_template();  // report.html
std::string_view page_style();     // report.css
// The page's own scripts, in the order in which the page must include them.
std::string_view page_charts();          // report.js
std::string_view page_explorer();        // explorer.js
std::string_view page_further_charts();  // charts.js
std::string_view plotly_script();        // plotly.min.js (MIT; THIRD_PARTY_NOTICES.md)

}  // namespace q3d::pipeline::report
