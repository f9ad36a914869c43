// The tables of docs/config.md, made from the settings.
#pragma once

#include <string>

namespace q3d::pipeline::config {

// Returns the page with each of its tables made anew. A table stands between the lines
// `<!-- settings: NAME -->` and `<!-- end of settings -->`; NAME is one of build, datasets, own labels,
// network, tta, filter, guards, shards, leakage and calibrate. Throws std::runtime_error for another name,
// for a table without its end, and for a name that the page lacks.
std::string with_settings_tables(const std::string& page);

}  // namespace q3d::pipeline::config
