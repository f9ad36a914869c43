// A dataset as the config names it: its format's records, or those that a curation list chose.
#pragma once

#include "loaders/formats/dataset.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::candidates {

// Without `curation`: loaders::load_dataset. With it: the records whose picture the list chose for this
// split, in file order; a species that the record lacks comes from the list, and the family from it; the list
// is one of the dataset's files. Throws ConfigError for options that make no sense and a list that is none,
// of another split, or of other annotation files; std::runtime_error as loaders::load_dataset does.
loaders::formats::Dataset load_configured(const config::DatasetConfig& options);

}  // namespace q3d::pipeline::candidates
