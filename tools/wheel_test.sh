#!/usr/bin/env bash
# tools/wheel_test.sh [WHEEL]: installs the wheel, built where none is given, into an empty environment, without extras,
# and flies from another folder, where no source is at hand.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=$PWD/.venv/bin/python
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
unset PYTHONPATH

if [[ $# -gt 0 ]]; then
    cp "$1" "$work"
else
    "$python" -m pip wheel --disable-pip-version-check --quiet --no-deps --wheel-dir "$work" .
fi
"$python" -m venv "$work/venv"
"$work/venv/bin/pip" install --disable-pip-version-check --quiet --prefer-binary "$work"/shipland-*.whl
mkdir "$work/elsewhere"
cd "$work/elsewhere"
"$work/venv/bin/shipland" version
"$work/venv/bin/shipland" scenarios >/dev/null
"$work/venv/bin/shipland" doctor
"$work/venv/bin/shipland" example own_pilot.py
cmp own_pilot.py "$OLDPWD/examples/own_pilot.py"
code=0
"$work/venv/bin/shipland" fly --scenario near --vision geometric --no-video --out out || code=$?
# 1 is a flight that did not land in the square: the wheel flies all the same.
[[ $code -le 1 ]] || { echo "shipland: the installed wheel does not fly" >&2; exit 1; }
for file in flight.mcap summary.json timing.json; do
    [[ -s out/$file ]] || { echo "shipland: the flight left no $file" >&2; exit 1; }
done
echo "the wheel flies: $(basename "$work"/shipland-*.whl), $(du -sm "$work/venv" | cut -f1) MB installed, exit code $code"
