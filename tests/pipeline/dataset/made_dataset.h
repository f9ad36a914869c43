// A small published dataset, written by hand: four candidates in two units of two, of which two are kept.
#pragma once

#include <filesystem>
#include <string>

namespace q3d::pipeline::dataset {

// Writes <folder>/made-0123456789ab with dataset.json, verdicts.csv and two shards, and <folder>/latest.
// Every digest that dataset.json holds is right. Returns the version's folder.
std::filesystem::path make_dataset(const std::filesystem::path& folder);

// The text of its verdicts.csv.
extern const char* const kVerdicts;

}  // namespace q3d::pipeline::dataset
