#!/usr/bin/env bash
# Detectors of the frigate and of its bar, trained on from the shipped weights: pictures, then training with rounds of
# what fooled them. About two and a half hours on one core; started again, it goes on where it stopped.
# Leaves OUT/frigate.onnx and OUT/frigate-bar.onnx.
# Usage: tools/train_frigate.sh [OUT] [KIND...]   (default out/train-frigate, ship bar); WORKERS=2 draws on two cores
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/train-frigate} workers=${WORKERS:-1}
kinds=("${@:2}")
[[ ${#kinds[@]} != 0 ]] || kinds=(ship bar)
shipland=${SHIPLAND:-.venv/bin/shipland}
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1
mkdir -p "$out"

cat >"$out/train.toml" <<'TOML'
[train]
patience = 100
warmup_steps = 40
average_decay = 0.99
calibration_pictures = 0
[train.augment]
min_visible = 0.75 # a hull that fills a window teaches that whatever fills one is a ship
[train.far]
learning_rate = 0.001
evaluate_every = 150
validation_pictures = 150
hard_rounds = 6
mine_pictures = 600
mine_keep = 600
hard_fraction = 0.35
TOML

pictures() { # NAME KIND COUNT SEED CROP CONFIG
    $shipland synth --out "$out/$1" --kind "$2" --count "$3" --seed "$4" --crop-px "$5" --config "$6" \
        --scenario frigate-sea5 --workers "$workers"
}
train() { # KIND STEPS WEIGHTS
    [[ -f $out/$1/detector.onnx ]] && return
    local more=()
    [[ -f $out/$1/last.safetensors ]] && more+=(--resume)
    $shipland train --data "$out/$1-near" "$out/$1-wide" --out "$out/$1" --steps "$2" --window-px 288 --seed 1 \
        --weights "$3" --config "$out/train.toml" "${more[@]}"
}

for kind in "${kinds[@]}"; do
    case $kind in
    ship) near=4000 wide=1200 steps=1200 name=frigate ;;
    bar) near=2500 wide=500 steps=600 name=frigate-bar ;;
    *)
        echo "train_frigate.sh: unknown kind $kind: ship or bar" >&2
        exit 2
        ;;
    esac
    seed=$([[ $kind == ship ]] && echo 61 || echo 63)
    pictures "$kind-near" "$kind" $near "$seed" 416 examples/frigate_pictures.toml
    pictures "$kind-wide" "$kind" $wide $((seed + 1)) 704 tools/frigate_decoys.toml
    train "$kind" $steps "$kind"
    cp "$out/$kind/detector.onnx" "$out/$name.onnx"
done
