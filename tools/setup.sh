#!/usr/bin/env bash
# Makes .venv ready for `make`: tools/setup.sh run | dev | train. Says nothing when there is nothing to do.
# A stamp in .venv holds this folder's path and a checksum of pyproject.toml; when either changes, it installs again.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

extra=${1:-run}
case $extra in
run) requirement='.[full]' ;;
dev) requirement='.[dev]' ;;
train) requirement='.[dev,train]' ;; # torch for Linux is gigabytes of CUDA; one that .venv has already is kept
*) echo "usage: tools/setup.sh run | dev | train" >&2 && exit 2 ;;
esac
graphics_packages=(libegl1 libgl1 libgl1-mesa-dri libegl-mesa0)
stamp="$PWD $(cksum <pyproject.toml)"

fail() {
    echo "shipland: $*" >&2
    exit 1
}

stamped() { # stamped run|dev|train: is that stamp there and current?
    [[ -f .venv/.ready-$1 && $(<".venv/.ready-$1") == "$stamp" ]]
}

can_make_environments() {
    "$python" -c 'import ensurepip, venv' >/dev/null 2>&1
}

# The first Python ≥ 3.11 on the path, the newest for which every package has a wheel before others; one that can make
# environments goes before one that cannot.
python=''
find_python() {
    local name candidate fallback=''
    for name in python3.13 python3.12 python3.11 python3.14 python3; do
        while IFS= read -r candidate; do
            "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 || continue
            python=$candidate
            can_make_environments && return
            fallback=${fallback:-$candidate}
        done < <(type -aP "$name" || true)
    done
    python=$fallback
}

# install_packages WHY PACKAGE…: by apt-get when root, else one line that says what to type.
install_packages() {
    local why=$1
    shift
    command -v apt-get >/dev/null || fail "$why; install the equivalent of Debian's packages: $*"
    [[ $(id -u) == 0 ]] || fail "$why; run: sudo apt-get update && sudo apt-get install -y $*"
    echo "shipland: $why; installing $* with apt-get"
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq </dev/null || fail "apt-get update failed; see the lines above"
    apt-get install -y -qq --no-install-recommends "$@" </dev/null >/dev/null ||
        fail "apt-get install -y $* failed; see the lines above"
}

if { [[ $extra != train ]] && stamped dev; } || stamped "$extra"; then
    .venv/bin/python -c '' 2>/dev/null && exit 0
fi

find_python
[[ $python ]] || fail "needs Python 3.11 or newer and found none; run: apt install python3 python3-venv (Debian 12, Ubuntu 24.04 or newer)"
missing=() packages=()
if ! can_make_environments; then
    missing+=("$python cannot make virtual environments") packages+=(python3-venv)
fi
if ! reason=$("$python" tools/check_graphics.py 2>/dev/null); then
    missing+=("the renderer cannot draw off screen: $reason") packages+=("${graphics_packages[@]}")
fi
if [[ ${packages[*]} ]]; then
    install_packages "$(IFS=';' && echo "${missing[*]}" | sed 's/;/; /g')" "${packages[@]}"
    find_python
    can_make_environments || fail "$python still cannot make virtual environments; install the venv package of its version"
    reason=$("$python" tools/check_graphics.py 2>/dev/null) || fail "still no off-screen OpenGL: $reason"
fi

# An environment that was moved, or whose Python is gone, is made anew; one made by hand without a stamp is kept.
clear=()
for file in .venv/.ready-*; do
    [[ ! -f $file || $(<"$file") == "$PWD "* ]] || clear=(--clear)
done
[[ ! -e .venv ]] || .venv/bin/python -c '' 2>/dev/null || clear=(--clear)
if [[ ! -e .venv || ${clear[*]} ]]; then
    "$python" -m venv "${clear[@]}" .venv
fi

echo "shipland: installing '$requirement' into .venv with $("$python" --version); the first time takes minutes"
.venv/bin/python -m pip install --disable-pip-version-check --quiet --prefer-binary -e "$requirement" ||
    fail "pip could not install '$requirement'; see the lines above"
echo "$stamp" >".venv/.ready-$extra"
