#!/usr/bin/env bash
# Checks that C++ sources are formatted as .clang-format says, and changes nothing:
#   tools/check_format.sh            every tracked source
#   tools/check_format.sh FILE...    these files
# The exit code is 1 if a file is not; `make format` formats all of them. Another major version of clang-format lays
# some lines out differently, so version 14 (Debian 12) is required: CLANG_FORMAT names it where it has another name.
set -euo pipefail
cd "$(dirname "$0")/.."

program=${CLANG_FORMAT:-$(command -v clang-format-14 || command -v clang-format || true)}
[ -n "$program" ] || { echo "check_format: clang-format is not installed; apt-get install clang-format" >&2; exit 2; }
version=$("$program" --version | sed -nE 's/.*version ([0-9]+).*/\1/p')
if [ "$version" != 14 ]; then
  echo "check_format: $program is version $version, expected 14; name another one in CLANG_FORMAT" >&2
  exit 2
fi

if [ $# -gt 0 ]; then
  files=("$@")
else
  mapfile -t files < <(git ls-files '*.h' '*.cpp')
fi
"$program" --dry-run -Werror "${files[@]}" || {
  echo "check_format: run \`make format\`" >&2
  exit 1
}
