// Candidates that are left out whatever their prediction: by the user's veto, or because their picture is in
// a test set.
#pragma once

#include <filesystem>

#include "manifests/digest.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::leakage {

// Marks these candidates, mentions them in the notes, and updates the label digests of their units. Leaked
// candidates are marked only if their role is `pseudo`; the others are only noted. `out` keeps the pictures'
// hashes and gets the lists of what was found (pipeline/leakage/leakage_lists.h). Throws ConfigError,
// std::runtime_error, Interrupted.
void leave_out(const config::BuildConfig& config, manifests::DigestCache& digests,
               const std::filesystem::path& out, bool quiet, candidates::Ingest& ingest);

}  // namespace q3d::pipeline::leakage
