#!/usr/bin/env bash
# The far detectors' weights from nothing on one machine with a GPU and a dozen cores, in nine minutes: pictures by all
# cores, then the detectors at once. Leaves OUT/{ship,bar}.onnx, their checkpoints, curves and cards.
# Usage: tools/train_gpu.sh OUT [START]   (START: a folder with {ship,bar}.safetensors that training goes on from)
# Environment: PYTHON WORKERS SEED DEVICE MEMORY STEPS BATCH, KINDS ("ship bar"), and minutes: SHIP_CROPS SHIP_FRAMES
# BAR_CROPS BAR_FRAMES TRAIN_UNTIL (from the start; writing the files takes half a minute more).
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
[train.far]
batch = ${BATCH:-160}
window_px = 288
learning_rate = 0.003
evaluate_every = 1500
validation_pictures = 500
hard_rounds = 6
mine_pictures = 5000
mine_keep = 5000
hard_fraction = 0.4
TOML

shipland() { "$python" -c 'import sys; from shipland.cli import main; sys.exit(main())' "$@"; }
pictures() { # KIND SET SEED MINUTES MOST [OPTION...]
    local begun=$SECONDS
    shipland synth --out "$work/$1-$2" --kind "$1" --count "$5" --seed "$3" --minutes "$4" --workers "$workers" \
        --config tools/hard_frames.toml "${@:6}" >/dev/null
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
running=()
for kind in ${KINDS:-ship bar}; do
    case $kind in
    ship) first=1 crops=${SHIP_CROPS:-0.6} frames=${SHIP_FRAMES:-0.9} ;;
    bar) first=3 crops=${BAR_CROPS:-0.4} frames=${BAR_FRAMES:-0.6} ;;
    esac
    pictures "$kind" crops $((10 * seed + first)) "$crops" 30000 --crop-px 416
    pictures "$kind" frames $((10 * seed + first + 1)) "$frames" 10000
    train "$kind" "$(left)" &
    running+=($!)
done
failed=0
for process in "${running[@]}"; do
    wait "$process" || failed=1
done
tail -n 25 "$out"/*.log
echo "$((SECONDS - began)) s"
exit $failed
