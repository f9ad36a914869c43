// report.html: one file that shows statistics.json and pictures of candidates, without a network.
#pragma once

#include <nlohmann/json.hpp>

#include <string>

namespace q3d::pipeline::report {

// JSON that can stand inside <script type="application/json">: no text of it can end the element. Bytes that
// are no UTF-8 become U+FFFD.
std::string script_json(const nlohmann::ordered_json& document);

// The page. `pictures` is a list of galleries (report_galleries.h). Every text of the dataset is in the two
// JSON elements alone, and the page's scripts set it as text.
std::string report_html(const nlohmann::ordered_json& statistics, const nlohmann::ordered_json& pictures);

}  // namespace q3d::pipeline::report
