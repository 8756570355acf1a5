#!/usr/bin/env bash
# The far detectors as the paper and YOLOv3 have them, but for the width: 2,000 whole pictures of the ship and 1,000 of
# the bar, shrunk to 416 px, published anchors, decoding and loss, no rounds of what fooled them. Of the width 1.0 a
# step takes 11 s of a core; with the default width both take an hour and a half of one. Leaves OUT/{ship,bar}.onnx.
# Usage: tools/train_published.sh [OUT]   (default out/train-published); on a GPU WIDTH=1.0 BATCH=32 STEPS=10000
# EVERY=1000; MINUTES ends each training in order after so long.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/train-published} width=${WIDTH:-0.25} steps=${STEPS:-2500}
shipland=${SHIPLAND:-.venv/bin/shipland}
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1
mkdir -p "$out"

cat >"$out/train.toml" <<TOML
[train]
decoding = "darknet"
anchors = "published"
hard_rounds = 0
patience = 100
calibration_pictures = 0
[train.loss]
box_error = "squared"
focal_power = 0.0
kind = 1.0
[train.augment]
mosaic = 0.0
min_side_px = 2.0
[train.photos]
held_out = 0.05
match_iou = 0.3
learning_rate = 0.001
evaluate_every = ${EVERY:-200}
validation_pictures = 100
[train.photos.augment]
scale_min = 0.8
scale_max = 1.4
TOML

train() { # KIND STEPS SEED
    $shipland synth --out "$out/$1-pictures" --kind "$1" --seed "$3"
    if [[ ! -f $out/$1/model-card.md ]]; then # written last
        local more=()
        [[ -z ${BATCH:-} ]] || more+=(--batch "$BATCH")
        [[ -z ${MINUTES:-} ]] || more+=(--minutes "$MINUTES")
        [[ -f $out/$1/last.safetensors ]] && more+=(--resume)
        $shipland train --data "$out/$1-pictures" --out "$out/$1" --profile photos --steps "$2" --width "$width" \
            --seed 1 --config "$out/train.toml" "${more[@]}"
    fi
    cp "$out/$1/detector.onnx" "$out/$1.onnx"
    echo "$out/$1.onnx"
}

train ship "$steps" 5
train bar $((steps / 2)) 6
