"""The notebooks run in a kernel as they stand, and what they keep is what they show: tables, pictures, no path."""

import gc
import importlib.util
import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


def executed(path):
    spec = importlib.util.spec_from_file_location("run_notebooks", ROOT / "tools" / "run_notebooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.executed(path)


def shown(notebook):
    """What kinds of output each code cell has."""
    return [
        sorted(kind for output in cell.outputs for kind in output.get("data", {output.output_type: ""}))
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["compare_pilots", "first_flight", "own_cue"]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore")  # Jupyter's own, of its sockets and event loops
def test_a_notebook_runs_and_shows_what_it_keeps(path, monkeypatch):
    nbformat, *_ = (
        pytest.importorskip(name, reason="wants Jupyter: pip install nbclient ipykernel")
        for name in ("nbformat", "nbclient", "ipykernel")
    )
    # The kernel finds this Python's `shipland`, and this checkout's sources.
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]))
    kept = nbformat.read(path, as_version=4)
    kinds = shown(kept)
    assert shown(executed(path)) == kinds
    gc.collect()  # Jupyter's process of the kernel warns where it is let go: here, not in another test
    assert {"image/png", "image/jpeg", "text/html"} & {kind for cell in kinds for kind in cell}
    assert path.stat().st_size < 150_000
