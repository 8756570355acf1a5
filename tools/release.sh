#!/usr/bin/env bash
# Builds what is published into dist/: source archive and wheel of the tag that is checked out, and flies from the wheel.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=$PWD/.venv/bin/python

tag=$(git describe --tags --exact-match --match 'v[0-9]*') || { echo "shipland: check out a tag, as v0.1.0" >&2; exit 1; }
[[ -z $(git status --porcelain) ]] || { echo "shipland: files differ from the tag $tag" >&2; exit 1; }
grep -Eq "^## ${tag#v}( |$)" CHANGELOG.md || { echo "shipland: CHANGELOG.md has no section '## ${tag#v}'" >&2; exit 1; }
grep -q "^version: ${tag#v}$" CITATION.cff || { echo "shipland: CITATION.cff names another version than $tag" >&2; exit 1; }
rm -rf dist
"$python" -m pip install --disable-pip-version-check --quiet build twine
"$python" -m build --outdir dist .
"$python" -m twine check --strict dist/*
"$python" tools/walks.py base --wheel dist/*.whl
