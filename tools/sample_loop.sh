#!/usr/bin/env bash
# Runs the paper's three stages on the rendered world, from scratch:
#   tools/sample_loop.sh model             pools, pre-trained encoders, Stage 1 (full schedule): models/lite.safetensors
#   tools/sample_loop.sh loop SCHEDULE SEED   Stage 1, Stage 2, Stage 3, and both networks on the test sets
# SCHEDULE is full or quick. Every step makes only what is missing, so a stopped run continues where it was.
set -euo pipefail
cd "$(dirname "$0")/.."

program=build/quadruped3d
home=data/loop

say() { printf '\n== %s\n' "$*" >&2; }

# There are two ranks on any machine, so that two cores are used and the bits do not depend on the number of cores. Use
# RANKS=1 to run several trainings side by side.
train() {
  if [ "${RANKS:-2}" = 1 ]; then
    "$program" train "$@" --threads 1
  else
    OMP_NUM_THREADS=1 .venv/bin/torchrun --standalone --no-python --nproc-per-node "${RANKS:-2}" "$program" train "$@"
  fi
}

prepare() {
  say "the rendered world"
  [ -f data/world/world.json ] || "$program" sample --out data/world
  say "training pools and the held-out one: every annotation packed into shards"
  local pool
  for pool in animal3d ctrlani3d superanimal held_out; do
    "$program" build --config "configs/world_pools/$pool.json" --out "$home/pools/$pool"
  done
  [ -f "$home/initial.safetensors" ] && [ -f "$home/priors.safetensors" ] ||
    "$program" init --size lite --stem models/efficientnet_lite0.safetensors --out "$home/initial.safetensors" \
      --priors "$home/priors.safetensors" --smal-asset data/world/assets/smal_synthetic.safetensors
  say "pre-training of the image encoders, shared by all stages"
  train --config configs/world_training.json --set frozen_stem_blocks=11 --stage pretrain --out "$home/pretrain"
}

# Prints the layers of the training config for a schedule and a seed. Stage 3 reads the output of this loop's Stage 2.
layers() {
  local schedule=$1 seed=$2 run=$3
  cat >"$run/run.json" <<JSON
{ "network": { "encoders": "../pretrain/model.safetensors" },
  "pools": { "quadruped3d": { "shards": ["stage2/latest"], "weight": 0.5 } },
  "model_dtype": "float16",
  "seed": $seed }
JSON
  printf -- '--config configs/world_training.json '
  [ "$schedule" = full ] || printf -- '--config configs/world_training_%s.json ' "$schedule"
  printf -- '--config %s/run.json' "$run"
}

stage1() {
  local schedule=$1 seed=$2 run=$3
  mkdir -p "$run"
  say "Stage 1 ($schedule schedule, seed $seed)"
  # shellcheck disable=SC2046
  train $(layers "$schedule" "$seed" "$run") --stage 1 --out "$run/stage1"
}

evaluate() {
  [ -f "$2/evaluation.json" ] ||
    "$program" evaluate --config configs/world_evaluation.json --checkpoint "$1/model.safetensors" --out "$2"
}

loop() {
  local schedule=$1 seed=$2
  local run=$home/$schedule-$seed
  stage1 "$schedule" "$seed" "$run"
  say "Stage 2: pseudo labels for the 2D-only pictures"
  printf '{ "network": { "checkpoint": "stage1/model.safetensors", "compute_threads": 1 } }\n' >"$run/stage2.json"
  local stage2=(--config configs/world_stage2.json --config "$run/stage2.json")
  [ -f "$run/thresholds.json" ] ||
    "$program" calibrate "${stage2[@]}" --out "$run/stage2" --write "$run/thresholds.json"
  stage2+=(--config "$run/thresholds.json")
  "$program" build "${stage2[@]}" --out "$run/stage2"
  say "how true the pseudo labels are"
  "$program" evaluate-labels "${stage2[@]}" --out "$run/stage2" \
    --truth data/world/truth/superanimal_quadruped_train.json --masks data/world --report "$run/labels"
  say "Stage 3: a fresh head on the same encoders, with the pseudo labels in place of the 2D annotations"
  # shellcheck disable=SC2046
  train $(layers "$schedule" "$seed" "$run") --stage 3 --out "$run/stage3"
  say "both networks on the test sets"
  evaluate "$run/stage1" "$run/evaluation1"
  evaluate "$run/stage3" "$run/evaluation3"
  say "what Stage 3 changed"
  "$program" compare --before "$run/evaluation1" --after "$run/evaluation3" --out "$run/comparison.json"
}

case "${1:-}" in
  model)
    prepare
    stage1 full 0 "$home/full-0"
    say "trained: $home/full-0/stage1/model.safetensors (models/lite.safetensors ships such a network)"
    ;;
  loop)
    prepare
    loop "${2:-full}" "${3:-0}"
    ;;
  *)
    echo "usage: tools/sample_loop.sh model | loop [full|quick] [SEED]" >&2
    exit 2
    ;;
esac
