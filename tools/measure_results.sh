#!/usr/bin/env bash
# Measures what docs/results.md says about the network that ships and about its labels, on rendered worlds, whose truth
# is known:
#   tools/measure_results.sh [STEP...]     network, rules, trust, priors, guards; without a step all of them
# The tables come into data/results/STEP.md. What is there already is not made again, so a run that was stopped goes on
# where it was. Remove data/results to measure another network. CHECKPOINT=FILE measures a network of your own.
set -euo pipefail
cd "$(dirname "$0")/.."

program=build/quadruped3d
python=.venv/bin/python
checkpoint=$(realpath "${CHECKPOINT:-models/lite.safetensors}")
home=data/results
pools=(41 42 43)  # seeds of three worlds that no choice was made on
mkdir -p "$home"

say() { printf '\n== %s\n' "$*" >&2; }

world() {
  local folder=$1
  shift
  [ -f "$folder/world.json" ] || "$program" sample --out "$folder" "$@"
}

# Renders the world of a seed, and writes the layer that puts it and the checkpoint into configs/world_stage2.json.
pool() {
  local seed=$1 share=$2
  world "$home/world$seed" --share "$share" --seed "$seed"
  cat >"$home/pool$seed.json" <<JSON
{ "name": "pool$seed",
  "datasets": [
    { "name": "superanimal", "format": "superanimal", "root": "world$seed/superanimal_quadruped",
      "annotations": "annotations/train.json", "images": "images", "split": "train", "role": "pseudo" }
  ],
  "network": { "checkpoint": "$checkpoint", "smal_asset": "world$seed/assets/smal_synthetic.safetensors",
               "compute_threads": 1 },
  "guards": { "priors": "world$seed/assets/priors_synthetic.safetensors" } }
JSON
}

# The thresholds come from a world of their own.
thresholds() {
  [ ! -f "$home/thresholds.json" ] || return 0
  say "thresholds"
  pool 51 0.5
  "$program" calibrate --config configs/world_stage2.json --config "$home/pool51.json" --out "$home/out51" \
    --write "$home/thresholds.json" >/dev/null
}

# Labels one pool by one rule and compares the labels with the truth: labels RULE SEED SETTING...
labels() {
  local rule=$1 seed=$2 report=$home/$1$2
  shift 2
  [ ! -f "$report/verdicts.csv" ] || return 0
  say "pool $seed by the rule $rule"
  local build=(--config configs/world_stage2.json --config "$home/pool$seed.json" --config "$home/thresholds.json"
               --out "$home/out$seed")
  local setting
  for setting in "$@"; do build+=(--set "$setting"); done
  "$program" build "${build[@]}" --quiet
  "$program" evaluate-labels "${build[@]}" --truth "$home/world$seed/truth/superanimal_quadruped_train.json" \
    --masks "$home/world$seed" --report "$report" >/dev/null
  cp "$home/out$seed/latest/verdicts.csv" "$report/verdicts.csv"
}

# Labels the three pools by one rule: all_pools RULE SETTING...
all_pools() {
  local rule=$1 seed
  shift
  thresholds
  for seed in "${pools[@]}"; do
    pool "$seed" 0.2
    labels "$rule" "$seed" "$@"
  done
}

# The folders of one rule's measurements.
folders() { printf "$home/$1%s " "${pools[@]}"; }
joined() { folders "$1" | sed 's/ $//; s/ /,/g'; }

differences() {
  local before=$1 after
  for after in "${@:2}"; do
    printf '\n### %s -> %s\n\n```\n' "$before" "$after"
    # shellcheck disable=SC2046
    "$program" compare-labels --before $(folders "$before") --after $(folders "$after")
    printf '```\n'
  done
}

network() {
  world data/world
  local evaluate=("$program" evaluate --config configs/world_evaluation.json --checkpoint "$checkpoint")
  say "the test splits"
  "${evaluate[@]}" --out "$home/evaluation"
  say "the test splits after adaptation"
  "${evaluate[@]}" --out "$home/adapted" --tta 30
  say "how long to adapt, and with how many keypoints"
  "${evaluate[@]}" --out "$home/curves" --limit 120 --tta 30 --visible 0.7,0.5,0.3 --tta-curve 0,5,10,20,30,50,70
}

rules() {
  all_pools paper
  all_pools refine_retained tta.refine_retained=true
  all_pools strict profile=strict
  "$python" tools/labels_table.py paper="$(joined paper)" refine_retained="$(joined refine_retained)" \
    strict="$(joined strict)"
  differences paper refine_retained strict
  differences refine_retained strict
  printf '\n### By L_proj of the prediction\n\n'
  # shellcheck disable=SC2046
  "$python" tools/labels_table.py --by-error $(folders paper)
}

trust() {
  all_pools refine_retained tta.refine_retained=true
  # shellcheck disable=SC2046
  "$python" tools/trust_scores.py $(folders refine_retained)
}

# On a fourth world, since the weights of the profile `strict` were chosen there.
priors() {
  thresholds
  pool 31 0.2
  local name rules=()
  for name in none pose_0.003 pose_0.01 shape_0.003 shape_0.01; do
    local settings=(tta.refine_retained=true)
    [ "$name" = none ] || settings+=("tta.${name%_*}_prior_weight=${name#*_}")
    labels "$name" 31 "${settings[@]}"
    rules+=("$name=$home/${name}31")
  done
  "$python" tools/labels_table.py "${rules[@]}"
}

# Each guard alone, beside the rule without guards.
guards() {
  local adapt=tta.refine_retained=true
  all_pools refine_retained "$adapt"
  all_pools visible "$adapt" guards.visible_min=8
  all_pools held_out "$adapt" guards.held_out_share=0.2 guards.held_out_patience=10
  all_pools pose "$adapt" guards.pose_deviation_max=2.5
  all_pools limbs "$adapt" guards.limb_factor_max=1.5
  all_pools sides "$adapt" guards.left_right_max=1.0
  all_pools trusted "$adapt" filter.min_trust=0.8
  differences refine_retained visible held_out pose limbs sides trusted
}

[ $# -gt 0 ] || set -- network rules trust priors guards
for step in "$@"; do
  case $step in
    network | rules | trust | priors | guards) ;;
    *)
      echo "usage: tools/measure_results.sh [network|rules|trust|priors|guards]..." >&2
      exit 2
      ;;
  esac
  if [ ! -f "$home/$step.md" ]; then
    "$step" >"$home/$step.md.part"
    mv "$home/$step.md.part" "$home/$step.md"
  fi
  cat "$home/$step.md"
done
