#!/usr/bin/env bash
# The far detectors' weights from nothing on a CPU: pictures, then training with rounds of what fools the detector.
# About four hours on one core; started again, it goes on where it stopped. Leaves OUT/{ship,bar}.onnx.
# On a machine with a GPU and many cores tools/train_gpu.sh does it in minutes.
# Usage: tools/train_shipped.sh [OUT]   (default out/train); WORKERS=2 draws on two cores
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/train} workers=${WORKERS:-1}
shipland=${SHIPLAND:-.venv/bin/shipland}
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1
mkdir -p "$out"

cat >"$out/train.toml" <<'TOML'
[train]
patience = 100
[train.far]
evaluate_every = 400
validation_pictures = 250
hard_rounds = 5
mine_pictures = 1500
mine_keep = 1500
hard_fraction = 0.35
TOML

pictures() { # NAME KIND COUNT SEED [OPTION...]
    "$shipland" synth --out "$out/$1" --kind "$2" --count "$3" --seed "$4" --workers "$workers" "${@:5}"
}
train() { # KIND STEPS START|-
    [[ -f $out/$1/model-card.md ]] && return # written last
    local more=()
    [[ $3 == - ]] || more+=(--weights "$3")
    [[ -f $out/$1/last.safetensors ]] && more+=(--resume)
    "$shipland" train --data "$out/$1-crops" "$out/$1-frames" --out "$out/$1" --steps "$2" --window-px 224 --seed 1 \
        --config "$out/train.toml" "${more[@]}"
}

pictures ship-crops ship 6000 1 --crop-px 352
pictures ship-frames ship 3000 2 --config tools/hard_frames.toml
train ship 5600 -
pictures bar-crops bar 3500 3 --crop-px 352
pictures bar-frames bar 1500 4 --config tools/hard_frames.toml
train bar 2400 "$out/ship/average.safetensors"

cp "$out/ship/detector.onnx" "$out/ship.onnx"
cp "$out/bar/detector.onnx" "$out/bar.onnx"
echo "$out/ship.onnx $out/bar.onnx"
