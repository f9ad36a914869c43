#!/usr/bin/env bash
# Trainings on the rendered world:
#   tools/sample_loop.sh model                how models/lite.safetensors was made: pre-trained encoders, Stage 1, and
#                                             two longer trainings with the pictures of further worlds
#   tools/sample_loop.sh loop SCHEDULE SEED   the paper's loop: Stage 1, Stage 2, Stage 3, and both networks on the test
#                                             sets. Both stages train a fresh head on the encoders of
#                                             models/lite.safetensors
#   tools/sample_loop.sh control SCHEDULE SEED
#                                             after `loop`: Stage 1 with SuperAnimal's pictures drawn as often as Stage 3
#                                             draws its labels, so that what is left of the gain is due to the labels
#   tools/sample_loop.sh ablations SCHEDULE SEED
#                                             after `loop`: Stage 1 without one component each
# SCHEDULE is full or quick. Every step does what is missing, so a run that was stopped goes on where it was.
set -euo pipefail
cd "$(dirname "$0")/.."

program=build/quadruped3d
home=data/loop
shipped=models/lite.safetensors

say() { printf '\n== %s\n' "$*" >&2; }

# Two ranks on any machine, so that two cores are used and the bits do not depend on how many there are. RANKS=1 is
# for running several trainings side by side.
train() {
  if [ "${RANKS:-2}" = 1 ]; then
    "$program" train "$@" --threads 1
  else
    "$program" train "$@" --ranks "${RANKS:-2}"
  fi
}

# A pool is a dataset in which every annotation is packed into shards.
pools() {
  local pool
  for pool in "$@"; do
    "$program" build --config "configs/world_pools/$pool.json" --out "$home/pools/$pool"
  done
}

prepare() {
  say "the rendered world"
  [ -f data/world/world.json ] || "$program" sample --out data/world
  say "training pools and the held-out one"
  pools animal3d ctrlani3d superanimal held_out
  [ -f "$home/initial.safetensors" ] && [ -f "$home/priors.safetensors" ] ||
    "$program" init --size lite --stem models/efficientnet_lite0.safetensors --out "$home/initial.safetensors" \
      --priors "$home/priors.safetensors" --smal-asset data/world/assets/smal_synthetic.safetensors
}

pretrain() {
  say "pre-training of the image encoders"
  train --config configs/world_training.json --set frozen_stem_blocks=11 --stage pretrain --out "$home/pretrain"
}

# Another world for training alone, and its pools.
another_world() {
  local name=$1 seed=$2 share=$3
  say "the $name world and its training pools"
  [ -f "data/${name}_world/world.json" ] ||
    "$program" sample --seed "$seed" --share "$share" --out "data/${name}_world"
  pools "${name}_animal3d" "${name}_ctrlani3d" "${name}_superanimal"
}

longer() {
  another_world more 101 2
  say "a longer training of the whole network"
  train --config configs/world_training.json --config configs/world_longer.json --stage longer --out "$home/longer"
}

longest() {
  another_world third 102 4
  say "a still longer training"
  train --config configs/world_training.json --config configs/world_longer.json --config configs/world_longest.json \
    --stage longest --out "$home/longest"
}

# The training config's layers for a schedule, a seed and a checkpoint whose encoders all stages start from. Stage 3
# reads what this loop's Stage 2 made.
layers() {
  local schedule=$1 seed=$2 run=$3 encoders=$4
  cat >"$run/run.json" <<JSON
{ "network": { "encoders": "$PWD/$encoders" },
  "pools": { "quadruped3d": { "shards": ["stage2/latest"], "weight": 0.5 } },
  "model_dtype": "float16",
  "seed": $seed }
JSON
  printf -- '--config configs/world_training.json '
  [ "$schedule" = full ] || printf -- '--config configs/world_training_%s.json ' "$schedule"
  printf -- '--config %s/run.json' "$run"
}

stage1() {
  local schedule=$1 seed=$2 run=$3 encoders=$4
  mkdir -p "$run"
  say "Stage 1 ($schedule schedule, seed $seed)"
  # shellcheck disable=SC2046
  train $(layers "$schedule" "$seed" "$run" "$encoders") --stage 1 --out "$run/stage1"
}

evaluate() {
  [ -f "$2/evaluation.json" ] ||
    "$program" evaluate --config configs/world_evaluation.json --checkpoint "$1/model.safetensors" --out "$2"
}

loop() {
  local schedule=$1 seed=$2
  local run=$home/$schedule-$seed
  stage1 "$schedule" "$seed" "$run" "$shipped"
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
  train $(layers "$schedule" "$seed" "$run" "$shipped") --stage 3 --out "$run/stage3"
  say "both networks on the test sets"
  evaluate "$run/stage1" "$run/evaluation1"
  evaluate "$run/stage3" "$run/evaluation3"
  say "what Stage 3 changed"
  "$program" compare --before "$run/evaluation1" --after "$run/evaluation3" --out "$run/comparison.json"
}

control() {
  local schedule=$1 seed=$2
  local run=$home/$schedule-$seed
  say "Stage 1 with more of SuperAnimal's 2D annotations"
  # shellcheck disable=SC2046
  train $(layers "$schedule" "$seed" "$run" "$shipped") --set pools.superanimal.weight=0.5 --stage 1 \
    --out "$run/control"
  evaluate "$run/control" "$run/evaluation_control"
  say "what more 2D annotations changed"
  "$program" compare --before "$run/evaluation1" --after "$run/evaluation_control"
  say "what the labels in their place changed"
  "$program" compare --before "$run/evaluation_control" --after "$run/evaluation3"
}

ablations() {
  local schedule=$1 seed=$2
  local run=$home/$schedule-$seed part
  for part in keypoint_tokens bio_features initial_betas; do
    say "Stage 1 without $part"
    # shellcheck disable=SC2046
    train $(layers "$schedule" "$seed" "$run" "$shipped") --set "network.without=[\"$part\"]" --stage 1 \
      --out "$run/without_$part"
    evaluate "$run/without_$part" "$run/evaluation_without_$part"
    say "what $part changes"
    "$program" compare --before "$run/evaluation_without_$part" --after "$run/evaluation1"
  done
}

case "${1:-}" in
  model)
    prepare
    pretrain
    stage1 full 0 "$home/model" "$home/pretrain/model.safetensors"
    longer
    longest
    say "trained: $home/longest/model.safetensors ($shipped is such a network)"
    ;;
  loop)
    prepare
    loop "${2:-full}" "${3:-0}"
    ;;
  control | ablations)
    "$1" "${2:-full}" "${3:-0}"
    ;;
  *)
    echo "usage: tools/sample_loop.sh model | loop|control|ablations [full|quick] [SEED]" >&2
    exit 2
    ;;
esac
