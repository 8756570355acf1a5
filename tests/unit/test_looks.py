"""What a detector makes of a labelled set: counts, the page that shows it, and the time that is left."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from shipland import progress
from shipland.learning.dataset import Dataset, Sample
from shipland.learning.looks import looks_at
from shipland.learning.metrics import Tally
from shipland.messages import Box
from shipland.progress import followed
from shipland.report.looks_page import looks_page


@dataclass
class Says:
    """A detector that says the same of every picture."""

    boxes: list

    def detect(self, picture, min_confidence):
        return [box for box in self.boxes if box.confidence >= min_confidence]


@pytest.fixture
def looks(tmp_path):
    """Two targets; one is hit at 0.8, the other only at 0.2; a box at 0.7 hits nothing."""
    path = tmp_path / "a<b.png"
    cv2.imwrite(str(path), np.full((100, 200, 3), 90, np.uint8))
    targets = np.array([[0, 0.25, 0.5, 0.1, 0.2], [0, 0.75, 0.5, 0.1, 0.2]], np.float32)
    boxes = [
        Box((49.5, 49.5), (20.0, 20.0), 0.8),
        Box((149.5, 51.5), (20.0, 20.0), 0.2),
        Box((99.5, 9.5), (9.0, 9.0), 0.7),
    ]
    dataset = Dataset(tmp_path, ("ship",), (Sample(path, targets, {}),))
    tally = Tally(0.5)
    found = list(looks_at(Says(boxes), dataset, [tally]))
    assert (tally.recall(0.1), tally.recall(0.5)) == (1.0, 0.5)
    return found


def test_what_counts_goes_by_the_confidence(looks):
    (look,) = looks
    assert look.missed == [] and look.above(0.5).missed == [1]
    assert look.verdict.tolist() == [0, 1, -1]
    np.testing.assert_allclose(look.boxes[0], [50.0, 50.0, 20.0, 20.0])


def test_the_page_shows_misses_false_boxes_and_hits(looks):
    page = looks_page(looks, 0.5, "held <out>", "a summary")
    for heading in ("Missed: 1", "False boxes: 1", "Detections: 1"):
        assert f"<h2>{heading}</h2>" in page
    assert page.count("data:image/jpeg;base64,") == 3
    assert "best box 0.20, 20 × 20 px<br>a&lt;b.png" in page
    assert "held &lt;out&gt;" in page and "http" not in page


@pytest.mark.parametrize(("share", "left"), [(None, "30 s left"), (lambda: 0.5, "time left not yet known")])
def test_lines_tell_the_time_left(share, left, monkeypatch, capsys):
    """Ten seconds an item of four: after the first thirty are left, unless its share says that nothing was done."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.0)

    def items():
        for _ in range(4):
            now[0] += 10.0
            yield "a note"

    assert len(list(followed(items(), "work", 4, share=share))) == 4
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == f"work: 1 of 4 after 10 s, {left}  a note"
