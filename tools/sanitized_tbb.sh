#!/usr/bin/env bash
# Compiles Debian's source of oneTBB for the thread sanitizer, which sees a race in everything that one task hands to
# another unless the library that hands it over is compiled for it too.
#
#   tools/sanitized_tbb.sh FOLDER
#
# The library and its CMake package go to FOLDER; if they are there already, nothing is done. apt fetches the source and
# checks its signature; the system's list of sources is not changed.
set -euo pipefail

folder=$(realpath -m "${1:?usage: tools/sanitized_tbb.sh FOLDER}")
[ ! -f "$folder/lib/cmake/TBB/TBBConfig.cmake" ] || exit 0
keyring=/usr/share/keyrings/debian-archive-keyring.gpg
# shellcheck source=/dev/null
. /etc/os-release
if [ "${ID:-}" != debian ]; then
  echo "sanitized_tbb: this system is ${ID:-unknown}, expected Debian, whose source package is compiled" >&2
  exit 1
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/lists/partial" "$work/source"
chmod 755 "$work" "$work/source"
cat >"$work/debian.sources" <<SOURCES
Types: deb-src
URIs: http://deb.debian.org/debian
Suites: $VERSION_CODENAME
Components: main
Signed-By: $keyring
SOURCES
apt=(apt-get -q -o "Dir::Etc::sourcelist=$work/debian.sources" -o Dir::Etc::sourceparts=/dev/null
     -o "Dir::State::lists=$work/lists")
"${apt[@]}" update
(cd "$work/source" && "${apt[@]}" source onetbb)
cmake -S "$work"/source/onetbb-*/ -B "$work/build" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DTBB_SANITIZE=thread \
  -DTBB_TEST=OFF -DTBBMALLOC_BUILD=OFF -DTBB_STRICT=OFF -DCMAKE_INSTALL_PREFIX="$folder.new" -DCMAKE_INSTALL_LIBDIR=lib
rm -rf "$folder.new" "$folder"
cmake --build "$work/build" --target install
mv "$folder.new" "$folder"
