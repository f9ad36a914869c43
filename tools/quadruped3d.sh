#!/usr/bin/env bash
# The main job behind `make quadruped3d`. Its arguments are OUT and optionally a config. Without a config it makes the
# rendered sample world first and labels it with the network that ships (models/), so that a newcomer sees a dataset
# within minutes and without any licence. Its pictures are others than those of data/world, which that network was
# trained on.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${1:?usage: tools/quadruped3d.sh OUT [CONFIG]}
config=${2:-}
program=build/quadruped3d
mkdir -p "$out"

if [ -z "$config" ]; then
  config=configs/sample.json
  # A world of an earlier version lacks the priors; `sample` adds them and leaves the pictures as they are.
  [ -f data/sample_world/world.json ] && [ -f data/sample_world/assets/priors_synthetic.safetensors ] ||
    "$program" sample --out data/sample_world --share 0.08 --seed 1
fi

layers=(--config "$config")
# Without a network there is nothing to calibrate: every dataset brings its labels.
if grep -q '"network"' "$config" && ! grep -q '"tau_low"' "$config"; then
  # Each config has its own thresholds file, because thresholds of another pool or network would be wrong.
  thresholds=$out/thresholds-$(basename "$config" .json).json
  if [ -f "$thresholds" ]; then
    echo "thresholds of an earlier calibration: $thresholds (remove it to calibrate anew)" >&2
  else
    "$program" calibrate "${layers[@]}" --out "$out" --write "$thresholds"
  fi
  layers+=(--config "$thresholds")
fi

"$program" build "${layers[@]}" --out "$out"
"$program" verify "$out"
"$program" inspect "$out" --sheet "$out/sheet.png"
"$program" report "$out"
