"""A printed cue has its true size: every page as a printer draws it, put together by the crosses' overlap."""

import cv2
import numpy as np
import pytest

import shipland
from shipland.camera import Camera
from shipland.commands.print_cue import PrintCue
from shipland.cue import Cue, Polygon
from shipland.errors import ConfigError, DataError
from shipland.report.print_sheets import PAPERS_MM, chessboard_drawing, cue_drawing, print_sheets, sheets_for

PX_PER_MM = 4.0
GREEN = (35, 85)
MM_PER_POINT = 25.4 / 72.0


def pages(path, px_per_mm=PX_PER_MM):
    """Size [mm] and picture (BGR) of each page."""
    found = []
    pdfium = pytest.importorskip("pypdfium2", reason="draws PDF pages: pip install pypdfium2")
    document = pdfium.PdfDocument(path)
    for page in document:
        image = np.asarray(page.render(scale=px_per_mm * MM_PER_POINT).to_pil())[:, :, ::-1].copy()
        found.append((np.array(page.get_size()) * MM_PER_POINT, image))
        page.close()
    document.close()
    return found


def is_green(image):
    return (image[..., 1] > 120) & (image[..., 0] < 60) & (image[..., 2] < 60)


def edges_mm(line):
    """Where a line of booleans changes."""
    return np.flatnonzero(np.diff(line.astype(int))) / PX_PER_MM


@pytest.mark.parametrize("paper", PAPERS_MM)
def test_a_page_is_the_paper(tmp_path, paper):
    square = Cue((Polygon.rectangle((0.0, 0.0), 0.1, 0.1),))
    print_sheets(tmp_path / "cue.pdf", cue_drawing(square, GREEN), paper, "square")
    ((size_mm, image),) = pages(tmp_path / "cue.pdf")
    assert sorted(size_mm) == pytest.approx(sorted(PAPERS_MM[paper]), abs=0.01)
    rows, columns = np.nonzero(is_green(image))
    for places in (rows, columns):
        assert np.ptp(places) / PX_PER_MM == pytest.approx(100.0, abs=0.5)  # a pixel at either edge
    # In the middle, and nothing but the ruler and its words at the foot.
    assert columns.mean() / PX_PER_MM == pytest.approx(0.5 * size_mm[0], abs=0.5)


def test_lengths_on_one_large_sheet(tmp_path):
    plates = [Polygon.rectangle((right_m, 0.0), 0.3, 0.1) for right_m in (-0.35, 0.35)]
    print_sheets(tmp_path / "cue.pdf", cue_drawing(Cue(tuple(plates)), GREEN), "A0", "my$bar_$^2")  # no formula
    ((_, image),) = pages(tmp_path / "cue.pdf")
    middle = is_green(image)[image.shape[0] // 2]
    assert np.diff(edges_mm(middle)) == pytest.approx([300.0, 400.0, 300.0], abs=0.5)


@pytest.mark.parametrize("paper", ["A4", "Letter", "A3"])
def test_sheets_laid_cross_on_cross_give_the_cue(tmp_path, paper):
    cue = Cue((Polygon.rectangle((0.0, 0.0), 0.55, 0.45),))
    drawing = cue_drawing(cue, GREEN)
    sheets = print_sheets(tmp_path / "cue.pdf", drawing, paper, "plate")
    found = pages(tmp_path / "cue.pdf")
    assert len(found) == sheets.across * sheets.down > 1
    step_px = np.round(PX_PER_MM * np.array(sheets.step_mm)).astype(int)
    height_px, width_px = found[0][1].shape[:2]
    whole = np.zeros((height_px + step_px[1] * sheets.down, width_px + step_px[0] * sheets.across), bool)
    for index, (_, image) in enumerate(found):
        row, column = divmod(index, sheets.across)
        top, left = row * step_px[1], column * step_px[0]
        whole[top : top + height_px, left : left + width_px] |= is_green(image)
    rows, columns = np.nonzero(whole)
    assert np.ptp(columns) / PX_PER_MM == pytest.approx(550.0, abs=1.0)
    assert np.ptp(rows) / PX_PER_MM == pytest.approx(450.0, abs=1.0)
    # no gap between sheets, but for the thin crosses
    inside = whole[rows.min() : rows.max(), columns.min() : columns.max()]
    assert inside.mean() > 0.995


def test_the_near_vision_sees_the_print_where_it_hangs(tmp_path):
    """The sheet as a camera straight before it sees it, 3 m away."""
    plates = [Polygon.rectangle((right_m, 0.0), 0.08, 0.06) for right_m in (-0.06, 0.06)]
    cue = Cue(tuple(plates), manufacturing_tolerance=0.003)
    print_sheets(tmp_path / "cue.pdf", cue_drawing(cue, GREEN), "A4", "plates")
    focal_px, distance_m = 1800.0, 3.0
    ((_, sheet),) = pages(tmp_path / "cue.pdf", 4.0 * focal_px / (1e3 * distance_m))
    sheet = cv2.resize(sheet, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    image = np.full((720, 1280, 3), 90, np.uint8)
    top, left = (720 - sheet.shape[0]) // 2, (1280 - sheet.shape[1]) // 2
    image[top : top + sheet.shape[0], left : left + sheet.shape[1]] = sheet
    camera = Camera(1280, 720, np.array([[focal_px, 0, 639.5], [0, focal_px, 359.5], [0, 0, 1.0]]), np.zeros(5))
    seen = shipland.see(image, cue=cue, camera=camera)
    assert seen.found, seen.to_line()
    assert seen.observation.bar_pose.position_in_bar_m[0] == pytest.approx(-distance_m, rel=0.01)


def test_a_chessboard_fits_its_finder(tmp_path):
    print_sheets(tmp_path / "board.pdf", chessboard_drawing("9x6", 0.025), "A4", "board")
    ((size_mm, image),) = pages(tmp_path / "board.pdf")
    assert size_mm[0] > size_mm[1]  # turned, so that it is one sheet
    good, corners = cv2.findChessboardCornersSB(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), (9, 6))
    assert good
    points_mm = corners.reshape(6, 9, 2) / PX_PER_MM
    assert np.linalg.norm(np.diff(points_mm, axis=1), axis=-1) == pytest.approx(25.0, abs=0.2)
    assert np.linalg.norm(np.diff(points_mm, axis=0), axis=-1) == pytest.approx(25.0, abs=0.2)  # a pixel is 0.25 mm


def test_a_white_cue_has_black_around_it(tmp_path):
    drawing = cue_drawing(Cue((Polygon.rectangle((0.0, 0.0), 0.1, 0.06),), hue="white"), GREEN)
    print_sheets(tmp_path / "cue.pdf", drawing, "A4", "white")
    ((_, image),) = pages(tmp_path / "cue.pdf")
    dark = image[image.shape[0] // 2].max(axis=-1) < 60
    assert np.diff(edges_mm(dark)) == pytest.approx([15.0, 100.0, 15.0], abs=0.5)


def test_what_lies_on_fewer_sheets_turned_is_turned():
    assert sheets_for((250.0, 100.0), "A4").page_mm == (297.0, 210.0)
    assert sheets_for((100.0, 250.0), "a4").page_mm == (210.0, 297.0)
    sheets = sheets_for((1000.0, 100.0), "A4")
    assert (sheets.across, sheets.down) == (4, 1)


def test_wrong_input_is_one_line(tmp_path):
    with pytest.raises(ConfigError, match=r"--paper A7 is not known; there are: A4"):
        PrintCue(paper="A7", out=tmp_path / "cue.pdf").run()
    with pytest.raises(ConfigError, match="give either a cue or --board"):
        PrintCue(tmp_path / "bar.toml", board="9x6", out=tmp_path / "cue.pdf").run()
    with pytest.raises(ConfigError, match="expected inner corners"):
        chessboard_drawing("9", 0.025)
    with pytest.raises(ConfigError, match=r"expected 0\.001 to 1 m"):
        chessboard_drawing("9x6", 25.0)
    cue = tmp_path / "bar.toml"
    cue.write_text("[rig]\n")
    with pytest.raises(ConfigError, match=r"bar\.toml is read here: name another file"):
        PrintCue(cue, out=cue).run()
    assert cue.read_text() == "[rig]\n"
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        PrintCue(out=tmp_path / "file" / "cue.pdf").run()


def test_the_command_says_what_to_print(tmp_path, capsys):
    assert PrintCue(out=tmp_path / "cue.pdf").run() == 0
    said = capsys.readouterr()
    assert "the rig's bar, 1200.0 × 150.0 mm on 8 sheets of A4, 8 × 1, portrait" in said.out
    assert "at 100 %" in said.err


def test_the_same_cue_is_the_same_file(tmp_path):
    for name in ("one.pdf", "two.pdf"):
        PrintCue(out=tmp_path / name).run()
    assert (tmp_path / "one.pdf").read_bytes() == (tmp_path / "two.pdf").read_bytes()


def test_a_print_that_is_broken_off_is_the_one_of_before(tmp_path, monkeypatch):
    PrintCue(out=tmp_path / "cue.pdf").run()
    before = (tmp_path / "cue.pdf").read_bytes()

    def stop_at_the_second(_, column, row):
        if column + row:
            raise KeyboardInterrupt
        return []

    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr("shipland.report.print_sheets._crosses", stop_at_the_second)
        PrintCue(out=tmp_path / "cue.pdf").run()
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [before]
