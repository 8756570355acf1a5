#!/usr/bin/env bash
# The far detectors' weights from nothing on one machine with a GPU and a dozen cores, in nine minutes: pictures by all
# cores, then both detectors at once. Leaves OUT/{ship,bar}.onnx, their checkpoints, curves and cards.
# Usage: tools/train_gpu.sh OUT [START]   (START: a folder with {ship,bar}.safetensors that training goes on from)
# Environment: PYTHON WORKERS SEED DEVICE MEMORY STEPS BATCH, and minutes: SHIP_CROPS SHIP_FRAMES BAR_CROPS BAR_FRAMES
# TRAIN_UNTIL (from the start; writing the files takes half a minute more).
set -euo pipefail
cd "$(dirname "$0")/.."
out=$1 start=${2:-} work=${WORK:-/tmp/shipland-train} python=${PYTHON:-python3}
workers=${WORKERS:-$(nproc)} seed=${SEED:-1}
export PYTHONPATH=$PWD/src${PYTHONPATH:+:$PYTHONPATH} OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 LP_NUM_THREADS=1
export PYTHONUNBUFFERED=1
mkdir -p "$out" "$work"
began=$SECONDS

cat >"$work/train.toml" <<TOML
[train]
warmup_steps = 300
average_decay = 0.9985
held_out = 0.03
patience = 1000
calibration_pictures = 0
[train.loss]
focal_power = 1.0
[train.far]
batch = ${BATCH:-256}
window_px = 224
learning_rate = 0.004
evaluate_every = 1000
validation_pictures = 300
hard_rounds = 6
mine_pictures = 6000
mine_keep = 6000
hard_fraction = 0.4
TOML

shipland() { "$python" -c 'import sys; from shipland.cli import main; sys.exit(main())' "$@"; }
pictures() { # KIND SET SEED MINUTES [OPTION...]
    local begun=$SECONDS
    shipland synth --out "$work/$1-$2" --kind "$1" --count 100000 --seed "$3" --minutes "$4" --workers "$workers" "${@:5}" \
        >/dev/null
    echo "$1-$2: $(find "$work/$1-$2/images" -name '*.jpg' | wc -l) pictures in $((SECONDS - begun)) s"
}
train() { # KIND MINUTES
    local more=()
    [[ -z $start ]] || more=(--weights "$start/$1.safetensors")
    shipland train --data "$work/$1-crops" "$work/$1-frames" --out "$work/$1" --steps "${STEPS:-100000}" \
        --minutes "$2" --seed "$seed" --threads 4 --config "$work/train.toml" --device "${DEVICE:-auto}" \
        --memory "${MEMORY:-auto}" "${more[@]}" >"$out/$1.log" 2>&1
    cp "$work/$1/detector.onnx" "$out/$1.onnx"
    cp "$work/$1/average.safetensors" "$out/$1.safetensors"
    cp "$work/$1/curves.png" "$out/$1-curves.png"
    cat "$work/$1/model-card.md" >>"$out/$1.log"
}
left() { # minutes until training has to end, less what it takes to load and to write
    "$python" -c "print(max(${TRAIN_UNTIL:-8.0} - $((SECONDS - began)) / 60 - 0.5, 0.2))"
}

"$python" -c 'from shipland.sim.scene.gl import open_context; print("drawn by", open_context().info["GL_RENDERER"])'
pictures ship crops $((10 * seed + 1)) "${SHIP_CROPS:-0.6}" --crop-px 352
pictures ship frames $((10 * seed + 2)) "${SHIP_FRAMES:-0.9}" --config tools/hard_frames.toml
train ship "$(left)" &
ship=$!
pictures bar crops $((10 * seed + 3)) "${BAR_CROPS:-0.4}" --crop-px 352
pictures bar frames $((10 * seed + 4)) "${BAR_FRAMES:-0.6}" --config tools/hard_frames.toml
train bar "$(left)" &
bar=$!
failed=0
wait $ship || failed=1
wait $bar || failed=1
tail -n 25 "$out"/*.log
echo "$((SECONDS - began)) s"
exit $failed
