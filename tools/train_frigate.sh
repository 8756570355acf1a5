#!/usr/bin/env bash
# A detector of the frigate, trained on from the shipped weights of the rig's platform: pictures, then training with
# rounds of what fooled it. About 45 minutes on one core; started again, it goes on where it stopped.
# Leaves OUT/frigate.onnx.
# Usage: tools/train_frigate.sh [OUT]   (default out/train-frigate); WORKERS=2 draws on two cores
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/train-frigate} workers=${WORKERS:-1}
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

pictures() { # NAME COUNT SEED CROP CONFIG
    $shipland synth --out "$out/$1" --kind ship --count "$2" --seed "$3" --crop-px "$4" --config "$5" \
        --scenario frigate-sea5 --workers "$workers"
}

pictures ship-near 4000 61 416 examples/frigate_pictures.toml
pictures ship-wide 1200 62 704 tools/frigate_decoys.toml
if [[ ! -f $out/ship/model-card.md ]]; then # written last
    more=()
    [[ -f $out/ship/last.safetensors ]] && more+=(--resume)
    $shipland train --data "$out/ship-near" "$out/ship-wide" --out "$out/ship" --steps 1200 --window-px 288 --seed 1 \
        --weights ship --config "$out/train.toml" "${more[@]}"
fi
cp "$out/ship/detector.onnx" "$out/frigate.onnx"
echo "$out/frigate.onnx"
