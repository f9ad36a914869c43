// The commands that need no LibTorch. Both programs have them: quadruped3d runs them, and quadruped3d-network
// describes them in completions and the manual page.
#pragma once

#include <array>

#include "pipeline/cli/program.h"

namespace q3d::pipeline::cli {

inline constexpr std::array<CommandEntry, 13> kPlainCommands{{
    {"verify", add_verify},
    {"status", add_status},
    {"inspect", add_inspect},
    {"config", add_config},
    {"explain", add_explain},
    {"leakage", add_leakage},
    {"curate", add_curate},
    {"topology", add_topology},
    {"export", add_export},
    {"corrections", add_corrections},
    {"merge", add_merge},
    {"subset", add_subset},
    {"diff", add_diff},
}};

}  // namespace q3d::pipeline::cli
