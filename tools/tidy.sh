#!/usr/bin/env bash
# Runs clang-tidy 14 with .clang-tidy, on changed files or on all of them:
#   tools/tidy.sh              files that differ from the merge base with origin/main, uncommitted ones too; where HEAD is
#                              origin/main or there is none, files that differ from HEAD~1
#   tools/tidy.sh COMMIT       files that differ from COMMIT
#   tools/tidy.sh --all        every source
#   tools/tidy.sh FILE...      these sources
# A changed header is checked through a source that includes it. A file that was only moved does not count as changed.
# Every finding is printed once. A source that was clean before, with the same headers, flags and checks, is not
# checked again, in whatever clone of this repository (an empty file for each in ~/.cache/quadruped3d-tidy). Exit
# codes: 0 no finding, 1 findings, 2 something is missing. BUILD (build/release) is a configured build folder, JOBS
# (all cores) how many files are checked at a time.
set -euo pipefail
exec python3 "$(dirname "$0")/tidy.py" "$@"
