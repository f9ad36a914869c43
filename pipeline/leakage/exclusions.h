// Candidates that are left out whatever their prediction: by the user's veto, or because their picture is in
// a test set.
#pragma once

#include <filesystem>

#include "manifests/digest.h"
#include "pipeline/candidates/ingest.h"
#include "pipeline/config/build_config.h"

namespace q3d::pipeline::leakage {

// Marks them, tells of them in the notes, and renews the label digests of their units. Of leaks only those of
// role `pseudo` are marked; the others are told. `out` keeps the pictures' hashes and gets the lists of what
// was found (pipeline/leakage/leakage_lists.h). Throws ConfigError, std::runtime_error, Interrupted.
void leave_out(const config::BuildConfig& config, manifests::DigestCache& digests,
               const std::filesystem::path& out, bool quiet, candidates::Ingest& ingest);

}  // namespace q3d::pipeline::leakage
