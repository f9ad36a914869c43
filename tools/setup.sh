#!/usr/bin/env bash
# Installs what the build needs: Debian packages (tools/debian-packages.txt), and the wheels of tools/requirements.txt,
# LibTorch among them, in a virtual environment at .venv. It installs only what is missing, so a second run takes a
# fraction of a second, and it repairs an installation that was interrupted. docs/install.md explains each dependency.
#
#   tools/setup.sh [--allow-upgrades | --no-upgrades] [--python-only] [--tests]
#
#   --allow-upgrades  allow apt to upgrade an installed package if a missing one cannot be installed otherwise
#   --no-upgrades     stop in that case; without either option setup asks, and upgrades where it cannot ask
#   --python-only     leave the Debian packages alone and make .venv only (for users without root)
#   --tests           also install what only the tests need, the wheels of tools/requirements-tests.txt
#   PYTHON=python3.12 in the environment names the interpreter of .venv (default: python3)
#
# The output of apt and pip goes to build/setup.log.
set -euo pipefail
cd "$(dirname "$0")/.."
export LC_ALL=C.UTF-8  # apt's and pip's messages are recognised in English

log=build/setup.log
python=${PYTHON:-python3}
lock_wait_s=${SETUP_LOCK_WAIT_S:-600}
lock_poll_s=${SETUP_LOCK_POLL_S:-5}
as_root=()
allow_upgrades=ask
python_only=no
for_tests=no
worked=no

say() { printf 'setup: %s\n' "$*" >&2; }

# fail MESSAGE...: prints each message on one line and ends the program.
fail() {
  say "$1"
  [ $# -lt 2 ] || printf '  %s\n' "${@:2}" >&2
  exit 1
}

# Prints the last lines of the last command's output.
last_output() {
  awk '/^== /{text = ""; next} !/^Requirement already/ {text = text $0 "\n"} END {printf "%s", text}' "$log" |
    tail -n "$1"
}

# fail_with_log MESSAGE...: prints the end of the log and then fails like fail.
fail_with_log() {
  say "the last lines of $log:"
  last_output 15 | sed 's/^/  | /' >&2
  fail "$@"
}

open_log() {
  mkdir -p "$(dirname "$log")"
  touch "$log"
  worked=yes
}

# Runs a command with its output in the log.
run() {
  printf '\n== %s: %s\n' "$(date '+%F %T')" "$*" >>"$log"
  "$@" </dev/null >>"$log" 2>&1
}

# --- Debian packages -------------------------------------------------------------------------------------------------

apt_install=(apt-get install -y -q --no-install-recommends --no-upgrade --no-remove
  -o APT::Get::Upgrade-By-Source-Package=false)  # by default, apt upgrades all installed packages of the same source
lock_message='Could not get lock|is another process using it|locked by another process'

missing_packages() {
  local installed
  installed=$(dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' | awk '$1 == "ii" {print $2}' | sort -u)
  comm -23 <(sort -u tools/debian-packages.txt) <(printf '%s\n' "$installed")
}

# True when dpkg was stopped in the middle: a package is half-installed, unpacked, half-configured or awaits a trigger,
# or dpkg's journal was not merged.
dpkg_is_unfinished() {
  compgen -G "${DPKG_ADMINDIR:-/var/lib/dpkg}/updates/[0-9]*" >/dev/null && return
  dpkg-query -W -f '${db:Status-Abbrev} ${Package}\n' | awk '$1 ~ /^.[HUFWt]/ {found = 1} END {exit !found}'
}

# Runs apt or dpkg as root. While another process holds their lock, it waits and tries again.
run_apt() {
  local waited=0 from status output holder
  while true; do
    from=$(wc -c <"$log")
    status=0
    run "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive "$@" || status=$?
    output=$(tail -c "+$((from + 1))" "$log")
    if [ $status -eq 0 ] || ! grep -qE "$lock_message" <<<"$output"; then return $status; fi
    holder=$(grep -oE 'process [0-9]+ \([^)]*\)|pid [0-9]+' <<<"$output" | head -n 1 || true)
    if [ "$waited" -ge "$lock_wait_s" ]; then
      fail "apt or dpkg has been in use by another program for $lock_wait_s s (${holder:-unknown process})." \
        "Wait until that program has finished (an automatic update, for example), then run make setup again."
    fi
    [ "$waited" -gt 0 ] ||
      say "another program is using apt or dpkg (${holder:-unknown process}); waiting for it, up to $lock_wait_s s"
    sleep "$lock_poll_s"
    waited=$((waited + lock_poll_s))
  done
}

become_root() {
  [ "$(id -u)" -ne 0 ] || return 0
  as_root=(sudo)
  if command -v sudo >/dev/null; then
    if sudo -n true 2>/dev/null || { [ -t 0 ] && sudo -v; }; then return; fi
  fi
  fail "these Debian packages are missing, and this user cannot install them: $*" \
    "Ask an administrator to run:" \
    "  apt-get update && apt-get install --no-install-recommends --no-upgrade $*" \
    "Then run make setup again. docs/install.md (\"Without root\") has other ways."
}

finish_interrupted_dpkg() {
  dpkg_is_unfinished || return 0
  say "an earlier installation of Debian packages was interrupted; finishing it (dpkg --configure -a)"
  run_apt dpkg --configure -a && return
  say "some of those packages lack others; installing these (apt-get --fix-broken install)"
  run_apt "${apt_install[@]}" --fix-broken ||
    fail_with_log "the interrupted installation of Debian packages cannot be finished." \
      "Repair it by hand (dpkg --configure -a; apt-get --fix-broken install), then run make setup again."
}

# Prints what apt would do, found by a simulation, as lines "upgrade NAME OLD NEW" and "new NAME VERSION".
plan() {
  "${apt_install[@]}" -s "$@" 2>>"$log" | sed -nE \
    -e 's/^Inst ([^ ]+) \[([^]]+)\] \(([^ ]+) .*/upgrade \1 \2 \3/p' -e 's/^Inst ([^ ]+) \(([^ ]+) .*/new \1 \2/p'
}

# A -dev package needs the library of exactly its own version. If the library is installed in an older version, this
# prints NAME=OLD for every new package of the same version that the archive still has in that older version.
older_versions() {
  local kind old new other fresh version
  while read -r kind _ old new; do
    [ "$kind" = upgrade ] || continue
    while read -r other fresh version; do
      [ "$other $version" = "new $new" ] || continue
      apt-cache madison "$fresh" | awk -F ' *[|] *' -v old="$old" -v fresh="$fresh" \
        '$2 == old && !printed {print fresh "=" old; printed = 1}'
    done <<<"$1"
  done <<<"$1" | sort -u
}

# Ends the program unless the user allows the upgrades that the plan $1 has.
ask_for_upgrades() {
  local upgrades=()
  mapfile -t upgrades < <(sed -nE 's/^upgrade ([^ ]+) ([^ ]+) (.*)/\1 \2 -> \3/p' <<<"$1")
  [ ${#upgrades[@]} -gt 0 ] || return 0
  say "missing packages need newer versions of these ${#upgrades[@]} installed ones, which apt would upgrade:"
  printf '  %s\n' "${upgrades[@]}" >&2
  [ "$allow_upgrades" != yes ] || return 0
  if [ "$allow_upgrades" = ask ] && [ ! -t 0 ]; then
    say "there is no terminal to ask at, and without them the build cannot go on: they are upgraded, nothing else is." \
      "tools/setup.sh --no-upgrades refuses instead"
    return 0
  fi
  if [ "$allow_upgrades" = ask ]; then
    local answer
    read -r -p "setup: upgrade them? [y/N] " answer
    case "$answer" in [yY] | [yY][eE][sS]) return 0 ;; esac
  fi
  fail "nothing was installed, because setup upgrades no installed package without your consent." \
    "To give it, run: make setup ALLOW_UPGRADES=1 (or tools/setup.sh --allow-upgrades)"
}

install_packages() {
  local missing=() older wanted planned better bytes others
  mapfile -t missing < <(missing_packages)
  [ ${#missing[@]} -gt 0 ] || return 0
  open_log
  become_root "${missing[@]}"
  finish_interrupted_dpkg
  mapfile -t missing < <(missing_packages)
  [ ${#missing[@]} -gt 0 ] || return 0
  run_apt apt-get update -q ||
    fail_with_log "the lists of Debian packages cannot be updated (apt-get update)." \
      "Check the network and /etc/apt/sources.list, then run make setup again."
  planned=$(plan "${missing[@]}") ||
    fail_with_log "apt cannot install these Debian packages: ${missing[*]}" \
      "The lines above say why. On another release than Debian 12, a package may have another name or be absent."
  mapfile -t older < <(older_versions "$planned")
  wanted=("${missing[@]}" "${older[@]}")
  if [ ${#older[@]} -gt 0 ] && better=$(plan "${wanted[@]}"); then
    planned=$better
  else  # there are none, or they do not fit together
    wanted=("${missing[@]}")
  fi
  ask_for_upgrades "$planned"
  bytes=$("${apt_install[@]}" -qq --print-uris "${wanted[@]}" 2>>"$log" | awk '{sum += $3} END {print sum + 0}')
  others=$(grep -c '^new ' <<<"$planned" || true)
  others=$((others > ${#missing[@]} ? others - ${#missing[@]} : 0))
  say "Debian packages to install: ${#missing[@]} and $others that they depend on," \
    "$(((bytes + 999999) / 1000000)) MB to download (${missing[*]})"
  run_apt "${apt_install[@]}" "${wanted[@]}" ||
    fail_with_log "apt-get could not install the Debian packages." "Once its cause is removed, run make setup again."
  mapfile -t missing < <(missing_packages)
  [ ${#missing[@]} -eq 0 ] || fail_with_log "apt-get reported success, but these are not installed: ${missing[*]}"
}

# --- Python wheels ---------------------------------------------------------------------------------------------------

# Makes .venv, or repairs it if it has another Python or no pip. $1 is the list of its wheels.
make_venv() {
  local version pinned
  version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])') ||
    fail "$python cannot be run." "PYTHON=/path/to/python3 tools/setup.sh names another interpreter."
  pinned=$(sed -n 's/^# CPython/CPython/p' "$1")
  grep -qE " $version( |,|\$)" <<<"$pinned" ||
    fail "$python is version $version, for which $1 pins no wheels ($pinned)." \
      "PYTHON=python3.11 tools/setup.sh names another interpreter."
  .venv/bin/python -m pip --version >/dev/null 2>&1 && return
  if [ -e .venv ] || [ -L .venv ]; then
    say ".venv is not whole (its Python or its pip does not run); making it anew"
    [ ! -L .venv ] || fail ".venv is a link to $(readlink .venv)." "Repair that environment or remove the link."
    rm -rf .venv
  fi
  run "$python" -m venv .venv ||
    fail_with_log "$python cannot make a virtual environment." "On Debian and Ubuntu it needs the package python3-venv."
}

# pip_advice LIST: says what to do after pip could not install the wheels of this list.
pip_advice() {
  local again="Then run make setup again; it continues with what is missing."
  case "$(last_output 40)" in
    *"No space left"*)
      echo "The disk is full. .venv takes 5 GB, and pip needs 3 GB more in ${TMPDIR:-/tmp} meanwhile. Make room."
      echo "$again"
      ;;
    *"DO NOT MATCH THE HASHES"*)
      echo "A file is not the one that $1 pins; a mirror or proxy may have replaced it."
      echo "Do not use it. \`pip config list\` shows which index pip asks."
      ;;
    # pip ends with "No matching distribution" after every failure to ask the index, so the causes come first.
    *"CERTIFICATE_VERIFY_FAILED"*)
      echo "pip does not trust the certificate with which the package index answers. Behind a proxy that signs its own,"
      echo "name the proxy's certificate: PIP_CERT=/etc/ssl/certs/ca-certificates.crt make setup"
      ;;
    *"Failed to establish"* | *"timed out"* | *"Name or service"* | *"resolution"*)
      echo "The package index cannot be reached. docs/install.md (\"Offline\") says how to install from a folder."
      echo "$again"
      ;;
    *"No matching distribution"*)
      echo "The package index, or the folder that stands for it, has no such wheel for $(uname -m) and this Python."
      echo "$1 names the wheels that are needed."
      ;;
    *) printf '%s\n' "The whole output is in $log. Remove the cause." "$again" ;;
  esac
}

# install_wheels NAME LIST OPTIONS...: installs the wheels that the file LIST pins, with these options of pip. A file
# .venv/installed-NAME-DIGEST says that it was done for a list with this digest.
install_wheels() {
  local name=$1 list=$2 stamp broken missing=() amount advice
  stamp=.venv/installed-$name-$(sha256sum "$list" | cut -c1-12)
  [ -f "$stamp" ] && [ -x .venv/bin/python ] &&
    compgen -G '.venv/lib/python3*/site-packages/torch/lib/libtorch_cpu.so' >/dev/null && return
  open_log
  make_venv "$list"
  # pip regards a package as installed if its metadata exists, even if few of its files were written.
  broken=$(.venv/bin/python tools/check_wheels.py --forget "$list") ||
    say "these packages in .venv are only half there and are installed anew: ${broken//$'\n'/, }"
  mapfile -t missing < <(.venv/bin/python tools/check_wheels.py "$list")
  if [ ${#missing[@]} -gt 0 ]; then
    amount="${#missing[@]} of $(grep -cE '^[a-z0-9-]+==' "$list")"
    case " ${missing[*]} " in
      *" torch "*) amount+=" Python wheels, LibTorch among them, into .venv (3 GB to download, 5 GB on disk)" ;;
      *" pyarrow "*) amount+=" Python wheels for the tests into .venv (190 MB to download, 650 MB on disk)" ;;
      *) amount+=" Python wheels into .venv: ${missing[*]}" ;;
    esac
    say "installing $amount"
    if ! run .venv/bin/python -m pip install --disable-pip-version-check --no-input --progress-bar off \
      --only-binary :all: --require-hashes "${@:3}" -r "$list"; then
      mapfile -t advice < <(pip_advice "$list")
      fail_with_log "pip could not install the Python wheels." "${advice[@]}"
    fi
    missing=("$(.venv/bin/python tools/check_wheels.py "$list")") ||
      fail "pip reported success, but .venv lacks files of these packages: ${missing[*]//$'\n'/, }" \
        "Remove .venv and run make setup again."
  fi
  rm -f ".venv/installed-$name"-*
  touch "$stamp"
}

for argument in "$@"; do
  case "$argument" in
    --allow-upgrades) allow_upgrades=yes ;;
    --no-upgrades) allow_upgrades=no ;;
    --python-only) python_only=yes ;;
    --tests) for_tests=yes ;;
    *)
      echo "usage: tools/setup.sh [--allow-upgrades | --no-upgrades] [--python-only] [--tests]" >&2
      exit 2
      ;;
  esac
done
if [ $python_only = no ]; then
  if command -v dpkg-query >/dev/null; then
    install_packages
  else
    say "this is not a Debian system: install the counterparts of tools/debian-packages.txt yourself"
  fi
fi
install_wheels build tools/requirements.txt
# One package of this list is published only as source. It is built with the setuptools of the first list, because pip
# would otherwise fetch one whose digest is not checked.
[ $for_tests = no ] || install_wheels tests tools/requirements-tests.txt --no-build-isolation --use-pep517
[ $worked = no ] || say "everything is installed ($SECONDS s)"
