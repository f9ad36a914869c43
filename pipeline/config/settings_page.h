// Makes the tables of settings in pages such as docs/config.md.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "pipeline/config/setting.h"

namespace q3d::pipeline::config {

// The settings of one page by the names of its tables.
using SettingsTables = std::map<std::string, std::vector<SettingFacts>>;

// Returns the tables build, datasets, own labels, network, tta, filter, guards, shards, leakage and
// calibrate.
SettingsTables build_settings_tables();

// Returns the page with each of its tables made anew. A table lies between the lines `<!-- settings: NAME
// -->` and `<!-- end of settings -->`. Throws std::runtime_error for a name that `tables` does not know, for
// a table without its end, and for a name that the page lacks.
std::string with_settings_tables(const std::string& page, const SettingsTables& tables);

// Returns whether the page has a table of one of these names.
bool has_settings_table(const std::string& page, const SettingsTables& tables);

}  // namespace q3d::pipeline::config
