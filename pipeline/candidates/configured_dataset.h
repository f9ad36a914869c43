// Loads a dataset of the config: all records of its files, or those that a curation list chose.
#pragma once

#include "loaders/formats/dataset.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::candidates {

// Without `curation`, this is loaders::load_dataset. With it, the records are those whose picture the list
// chose for this split, in file order. A species that the record lacks comes from the list, and the family
// follows from it. The list is one of the dataset's files. Throws ConfigError for options that make no sense,
// and for a list that is malformed, of another split, or of other annotation files. Throws std::runtime_error
// as loaders::load_dataset does.
loaders::formats::Dataset load_configured(const config::DatasetConfig& options);
// Loads the dataset in parts (loaders::formats::stream_dataset). The returned dataset has no records.
loaders::formats::Dataset stream_configured(const config::DatasetConfig& options,
                                            const loaders::formats::TakeRecords& take);

}  // namespace q3d::pipeline::candidates
