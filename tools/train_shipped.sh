#!/usr/bin/env bash
# The far detectors' weights from nothing: pictures, training, rounds of windows that fooled the last detector.
# About four hours on one core; started again, it goes on where it stopped. Leaves OUT/{ship,bar}.onnx.
# Usage: tools/train_shipped.sh [OUT]   (default out/train)
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/train}
shipland=${SHIPLAND:-.venv/bin/shipland}
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1
mkdir -p "$out"

cat >"$out/decoys.toml" <<'TOML' # more of what is no ship
[synth]
empty_share = 0.6
vessels = 2.0
buoys = 2.0
birds = 0.8
greens = 1.5
TOML
cat >"$out/frames.toml" <<'TOML' # whole frames that a detector is to be fooled by
[synth]
uniform_share = 0.85
empty_share = 0.35
least_contrast = 0.1
rainy = 0.18
vessels = 1.2
buoys = 1.5
birds = 0.8
greens = 1.0
TOML

settings() { # NAME RATE POWER WARM-UP FREEZE EVALUATE MINE LOOKED-AT KEPT SHARE: a training run's settings
    cat >"$out/$1.toml" <<TOML
[train]
warmup_steps = $4
freeze_norm = $5
[train.loss]
focal_power = $3
[train.far]
learning_rate = $2
evaluate_every = $6
validation_pictures = 250
mine_every = $7
mine_pictures = $8
mine_keep = $9
hard_fraction = ${10}
TOML
}
settings first 0.002 1.5 150 false 300 600 800 250 0.25
settings second 0.001 0.5 60 false 200 200 1000 350 0.35
settings bar 0.0015 0.5 60 false 250 250 1000 350 0.3
settings third 0.0008 0.5 60 true 400 500 2000 700 0.35
settings fourth 0.0005 0.5 60 true 350 350 1500 500 0.35
settings bar-second 0.0007 0.5 60 true 400 250 1200 400 0.35

pictures() { # NAME KIND COUNT SEED [OPTION...]
    "$shipland" synth --out "$out/$1" --kind "$2" --count "$3" --seed "$4" --crop-px 352 "${@:5}"
}
train() { # NAME STEPS CONFIG START|- SET...
    [[ -f $out/$1/detector.onnx ]] && return
    local more=() set data=()
    for set in "${@:5}"; do data+=("$out/$set"); done
    [[ $4 == - ]] || more+=(--weights "$out/$4/best.safetensors")
    [[ -f $out/$1/last.safetensors ]] && more+=(--resume)
    "$shipland" train --data "${data[@]}" --out "$out/$1" --steps "$2" --window-px 224 --seed 1 \
        --config "$out/$3.toml" "${more[@]}"
}

pictures ship ship 5025 1
train ship-1 2400 first - ship
pictures ship-decoys ship 2200 2 --config "$out/decoys.toml"
train ship-2 600 second ship-1 ship ship-decoys
pictures ship-hard ship 2500 3 --config "$out/frames.toml" --fooling "$out/ship-2/detector.onnx"
train ship-3 1200 third ship-2 ship ship-decoys ship-hard
pictures ship-harder ship 1300 4 --config "$out/frames.toml" --fooling "$out/ship-3/detector.onnx"
train ship-4 1400 fourth ship-3 ship ship-decoys ship-hard ship-harder

pictures bar bar 3000 1
pictures bar-decoys bar 800 2 --config "$out/decoys.toml"
train bar-1 700 bar ship-2 bar bar-decoys
pictures bar-hard bar 900 3 --config "$out/frames.toml" --fooling "$out/bar-1/detector.onnx"
train bar-2 800 bar-second bar-1 bar bar-decoys bar-hard

cp "$out/ship-4/detector.onnx" "$out/ship.onnx"
cp "$out/bar-2/detector.onnx" "$out/bar.onnx"
echo "$out/ship.onnx $out/bar.onnx"
