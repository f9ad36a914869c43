#!/usr/bin/env bash
# Fuzzes every target for SECONDS (default 60) each: tools/fuzz.sh BUILD_FOLDER [SECONDS] [TARGET...] The inputs that
# libFuzzer generates stay in BUILD_FOLDER/corpus, where the next run continues. An input that causes a failure is kept
# in BUILD_FOLDER/findings; the run then ends with its name and the command that repeats it.
set -euo pipefail
build=$1
seconds=${2:-60}
wanted=("${@:3}")
# A damaged HDF5 file makes that library request petabytes; it handles the refusal as an error, as it should. It also
# requests up to 4 GB that it never touches, so the limit applies to the memory in use (rss) and not to requests.
export ASAN_OPTIONS=allocator_may_return_null=1:${ASAN_OPTIONS:-}
here=$(cd "$(dirname "$0")/.." && pwd)

while read -r name inputs; do
  if ((${#wanted[@]} > 0)) && [[ " ${wanted[*]} " != *" $name "* ]]; then continue; fi
  mkdir -p "$build/corpus/$name" "$build/findings/$name"
  echo "== $name, $seconds s"
  log="$build/findings/$name.log"
  # shellcheck disable=SC2086  # inputs is a list of folders
  if ! "$build/tests/fuzz/fuzz_$name" -max_total_time="$seconds" -timeout=30 -rss_limit_mb=3072 -malloc_limit_mb=8192 \
      -max_len=65536 \
      -dict="$here/tests/fuzz/json.dict" -artifact_prefix="$build/findings/$name/" -print_final_stats=1 \
      "$build/corpus/$name" $inputs >"$log" 2>&1; then
    tail -n 60 "$log"
    input=$(ls -t "$build/findings/$name" | head -n 1)
    echo "fuzz: $name broke a promise; repeat it with:"
    echo "  $build/tests/fuzz/fuzz_$name $build/findings/$name/$input"
    echo "Once it is repaired, put the input into tests/fuzz/corpus/$name, so that every build replays it."
    exit 1
  fi
  grep -E "^stat::number_of_executed_units|^stat::peak_rss_mb" "$log"
done <"$build/tests/fuzz/targets.txt"

# Fuzz the importers of official files, which are written in Python.
if ((${#wanted[@]} == 0)) || [[ " ${wanted[*]} " == *" importers "* ]]; then
  python=${FUZZ_PYTHON:-$here/.venv/bin/python}
  if ! "$python" -c "import atheris, numpy" 2>/dev/null; then
    echo "fuzz: importers was NOT fuzzed: $python has no atheris. Install atheris and numpy from PyPI into a virtual"
    echo "environment of their own, and name its python in FUZZ_PYTHON."
  else
    mkdir -p "$build/corpus/importers" "$build/findings/importers"
    echo "== importers, $seconds s"
    log="$build/findings/importers.log"
    if ! "$python" "$here/tests/fuzz/importers_fuzz.py" "$build/corpus/importers" "$here/tests/fuzz/corpus/importers" \
        -max_total_time="$seconds" -timeout=30 -rss_limit_mb=3072 -max_len=65536 -print_final_stats=1 \
        -artifact_prefix="$build/findings/importers/" >"$log" 2>&1; then
      tail -n 60 "$log"
      echo "fuzz: importers broke a promise; its input is in $build/findings/importers"
      exit 1
    fi
    grep -E "^stat::number_of_executed_units|^stat::peak_rss_mb|^Done" "$log"
  fi
fi
echo "fuzz: no promise was broken by the targets that ran"
