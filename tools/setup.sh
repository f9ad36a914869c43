#!/usr/bin/env bash
# Installs what the build needs and nothing else: Debian packages, and a virtual environment in this repository
# with the pinned LibTorch wheel. Does only what is missing; a second run takes a fraction of a second.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf 'setup: %s\n' "$*" >&2; }

missing_packages() {
  local installed
  installed=$(dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' 2>/dev/null | awk '$1 == "ii" {print $2}' | sort -u)
  comm -23 <(sort -u tools/debian-packages.txt) <(printf '%s\n' "$installed")
}

install_packages() {
  local missing=() runner=()
  mapfile -t missing < <(missing_packages)
  [ ${#missing[@]} -eq 0 ] && return
  local command="apt-get update && apt-get install -y --no-install-recommends ${missing[*]}"
  if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null; then
      say "these Debian packages are missing and this user cannot install them. Ask an administrator to run:"
      printf '  %s\n' "$command" >&2
      exit 1
    fi
    runner=(sudo)
  fi
  say "installing ${#missing[@]} Debian packages: ${missing[*]}"
  "${runner[@]}" apt-get update -q >&2
  "${runner[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}" >&2
}

install_python() {
  local stamp=".venv/installed-$(sha256sum tools/requirements.txt | cut -c1-12)"
  [ -f "$stamp" ] && return
  say "installing LibTorch (PyTorch 2.11.0 wheel, about 5 GB on disk) into .venv"
  python3 -m venv .venv
  .venv/bin/python -m pip install --quiet --disable-pip-version-check -r tools/requirements.txt >&2
  rm -f .venv/installed-*
  touch "$stamp"
}

if command -v dpkg-query >/dev/null; then
  install_packages
else
  say "this is not a Debian system: make sure that the counterparts of tools/debian-packages.txt are installed"
fi
install_python
