// `inspect` exists in both programs; only the one that can pose bodies draws sheets.
#pragma once

#include "pipeline/cli/commands.h"
#include "pipeline/report/contact_sheet.h"

namespace q3d::pipeline::cli {

// Without a loader, the command runs only without --sheet.
Command add_inspect_with(CLI::App& app, const device::BodyMeshesLoader& load_bodies);

}  // namespace q3d::pipeline::cli
