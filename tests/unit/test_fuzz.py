"""The fuzzer's targets on a few inputs each; `make fuzz` runs them for an hour."""

import numpy as np
import pytest

pytest.importorskip("pymavlink")

import fuzz

INPUTS = {
    "pilots": 1,  # of 200 cycles
    "results": 4,
    "pictures": 2,
    "configurations": 25,
    "logs": 20,
    "networks": 10,
    "calibrations": 200,
    "mavlink": 2,  # of 2,000 datagrams
}
"""Of each target; of signals, tests/conformance and tests/scenarios have tests of their own."""


@pytest.mark.vision_fails
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of hostile numbers, which only warn in flight
@pytest.mark.parametrize("name", INPUTS)
def test_nothing_hostile_breaks(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    target = fuzz.target(fuzz.TARGETS[name])
    for seed in range(1, INPUTS[name] + 1):
        target(np.random.default_rng(seed))
        for item in tmp_path.iterdir():
            item.unlink()


def test_every_target_is_there():
    assert all(callable(fuzz.target(path)) for path in fuzz.TARGETS.values())


@pytest.mark.slow
def test_findings_are_kept_with_what_repeats_them(tmp_path, monkeypatch):
    """Of three inputs one raises, one ends the process, and the third is sound; told apart by their seeds."""
    lines = ["import os", "from pathlib import Path", "def target(rng):"]
    lines += ["    kind = int(rng.integers(3))", "    Path('input.bin').write_bytes(bytes([kind]))"]
    lines += ["    if kind == 0:", "        raise RuntimeError('hostile')", "    if kind == 1:", "        os._exit(7)"]
    (tmp_path / "brittle.py").write_text("\n".join(lines))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(fuzz.TARGETS, "brittle", "brittle:target")
    kinds = {seed: int(np.random.default_rng(seed).integers(3)) for seed in range(1, 21)}
    first = {kind: min(seed for seed in kinds if kinds[seed] == kind) for kind in range(3)}
    with pytest.raises(SystemExit, match="2 findings in"):
        fuzz.main(count=20, only=("brittle",), out=tmp_path / "out")
    kept = {place.name: (place / "finding.txt").read_text() for place in (tmp_path / "out").iterdir()}
    raised, died = kept[f"brittle-{first[0]}"], kept[f"brittle-{first[1]}"]
    assert "RuntimeError: hostile" in raised
    assert f"--only brittle --seed {first[0]} --count 1" in raised
    assert "the process died: exit code 7" in died
    assert (tmp_path / "out" / f"brittle-{first[1]}" / "input.bin").read_bytes() == b"\x01"
