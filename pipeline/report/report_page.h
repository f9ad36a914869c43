// report.html: one file that shows statistics.json and pictures of candidates, without a network.
#pragma once

#include <nlohmann/json.hpp>

#include <string>

namespace q3d::pipeline::report {

// Returns JSON that is safe inside <script type="application/json">: no text in it can end the element. Bytes
// that are not UTF-8 become U+FFFD.
std::string script_json(const nlohmann::ordered_json& document);

// Returns the page. `pictures` is a list of galleries (report_galleries.h). Texts of the dataset occur only
// in the two JSON elements, and the page's scripts insert them as text.
std::string report_html(const nlohmann::ordered_json& statistics, const nlohmann::ordered_json& pictures);

}  // namespace q3d::pipeline::report
