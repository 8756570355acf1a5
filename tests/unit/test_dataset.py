"""Labelled pictures: what is read, what is refused by name, how sets are split and exported."""

import cv2
import numpy as np
import pytest

from shipland.errors import DataError
from shipland.learning.dataset import coco_table, read_dataset

LATIN = "Brücke\n".encode("latin-1")


@pytest.fixture
def folder(tmp_path):
    """Ten grey pictures of 64 × 48 px, a white square of 8 px in each but the last."""
    (tmp_path / "images").mkdir()
    (tmp_path / "labels").mkdir()
    (tmp_path / "classes.txt").write_text("ship\n")
    for number in range(10):
        picture = np.full((48, 64, 3), 90, np.uint8)
        line = ""
        if number < 9:
            left, top = 4 * number, 3 * number
            picture[top : top + 8, left : left + 8] = 255
            line = f"0 {(left + 4) / 64} {(top + 4) / 48} {8 / 64} {8 / 48}\n"
        cv2.imwrite(str(tmp_path / "images" / f"p{number}.jpg"), picture)
        (tmp_path / "labels" / f"p{number}.txt").write_text(line)
    return tmp_path


def test_targets_come_in_pixels(folder):
    dataset = read_dataset(folder)
    assert dataset.classes == ("ship",)
    picture, targets = dataset.samples[3].load()
    assert picture.shape == (48, 64, 3)
    np.testing.assert_allclose(targets, [[0, 16, 13, 8, 8]], atol=1e-4)  # float32 of the fractions
    assert dataset.samples[9].load()[1].shape == (0, 5)


def test_coco_boxes_are_corner_and_size(folder):
    table = coco_table(read_dataset(folder))
    assert len(table["images"]) == 10
    assert len(table["annotations"]) == 9
    assert table["annotations"][3]["bbox"] == pytest.approx([12.0, 9.0, 8.0, 8.0], abs=0.01)
    assert table["categories"] == [{"id": 1, "name": "ship"}]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0 0.5 0.5 0.1", "expected 'class centre_x"),
        ("0 0.5 0.5 0.1 nan", "expected 'class centre_x"),
        ("ship 0.5 0.5 0.1 0.1", "expected 'class centre_x"),
        ("1 0.5 0.5 0.1 0.1", "unknown class 1"),
        ("0.5 0.5 0.5 0.1 0.1", "unknown class 0.5"),
        ("0 0.5 0.5 0 0.1", "both must be positive"),
        ("0 0.98 0.5 0.1 0.1", "outside the picture"),
    ],
)
def test_bad_label_is_named_with_its_line(folder, line, message):
    (folder / "labels" / "p4.txt").write_text(f"0 0.5 0.5 0.1 0.1\n{line}\n")
    with pytest.raises(DataError, match=message) as caught:
        read_dataset(folder)
    assert "p4.txt, line 2" in str(caught.value)


def test_many_bad_labels_are_one_line_with_a_count(folder):
    for name in ("p2", "p4", "p5"):
        (folder / "labels" / f"{name}.txt").write_text("0 0.5 0.5 0.1 0.1 0.9\n")  # with a confidence
    with pytest.raises(DataError, match=r"p2\.txt, line 1.*; 3 of the set's \d+ labels cannot be used$") as caught:
        read_dataset(folder)
    assert "\n" not in str(caught.value)


def test_keypoints_are_not_taken_for_polygons(folder):
    (folder / "labels" / "p4.txt").write_text("0 0.5 0.5 0.2 0.2 0.4 0.5 2 0.6 0.5 2\n")
    with pytest.raises(DataError, match="keypoints are not read"):
        read_dataset(folder)


def test_missing_label_is_named(folder):
    (folder / "labels" / "p7.txt").unlink()
    with pytest.raises(DataError, match=r"p7\.jpg has no label"):
        read_dataset(folder)


@pytest.mark.parametrize("keep", [0, 200, 500])
def test_truncated_picture_is_named(folder, keep):
    path = folder / "images" / "p2.jpg"
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(DataError, match=r"p2\.jpg is not a whole picture"):
        [sample.load() for sample in read_dataset(folder).samples]


def test_empty_folder_and_missing_folder(tmp_path):
    with pytest.raises(DataError, match="is no folder"):
        read_dataset(tmp_path / "none")
    with pytest.raises(DataError, match="holds no picture"):
        read_dataset(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "nc: 2\nnames: ['ship', \"fishing boat\"]\n",
        "names:\n- ship\n- fishing boat # small\nnc: 2\n",
        "train: images\nnames:\n  0: ship\n  1: 'fishing boat'\n",
        "names: {0: ship, 1: fishing boat}\n",
    ],
)
def test_classes_come_from_the_sets_own_file(folder, text):
    (folder / "classes.txt").unlink(missing_ok=True)
    (folder / "data.yaml").write_text(text)
    assert read_dataset(folder).classes == ("ship", "fishing boat")
    assert read_dataset(folder, ["a", "b"]).classes == ("a", "b")


def test_classes_may_be_named_above_the_set(folder, tmp_path_factory):
    above = tmp_path_factory.mktemp("above")
    (above / "classes.txt").write_text("ship\n")
    (folder / "classes.txt").unlink()
    assert read_dataset(folder.rename(above / "set")).classes == ("ship",)


def test_a_set_that_does_not_name_its_classes_is_refused(folder):
    (folder / "classes.txt").unlink(missing_ok=True)
    with pytest.raises(DataError, match=r"write classes.txt there, one name a line, number 0 first"):
        read_dataset(folder)


def test_polygons_become_their_upright_boxes(folder):
    label = sorted((folder / "labels").iterdir())[0]
    label.write_text("0 0.2 0.3 0.6 0.3 0.5 0.7 0.2 0.6\n")
    boxes = read_dataset(folder, ["ship"]).samples[0].boxes
    np.testing.assert_allclose(boxes, [[0.0, 0.4, 0.5, 0.4, 0.4]], atol=1e-6)


@pytest.mark.parametrize("name", ["classes.txt", "data.yaml", "scenes.jsonl"])
def test_a_table_in_another_encoding_is_one_line(folder, name):
    if name == "data.yaml":
        (folder / "classes.txt").unlink()
    (folder / name).write_bytes(LATIN)
    with pytest.raises(DataError, match=rf"{name} is not text in UTF-8"):
        read_dataset(folder)


@pytest.mark.parametrize(
    "line", ["[" * 100_000, '{"file": ' * 100 + "1" + "}" * 100, "1" * 5000, '{"file": [1]}', "[]"]
)
def test_a_line_of_scenes_that_is_none_is_named(folder, line):
    (folder / "scenes.jsonl").write_text(f'{{"file": "0.jpg"}}\n{line}\n')
    with pytest.raises(DataError, match=r"scenes\.jsonl, line 2: expected a JSON object with a key 'file'"):
        read_dataset(folder)


def test_a_byte_order_mark_is_no_part_of_a_name_or_a_number(folder):
    (folder / "classes.txt").write_text("ship\n", encoding="utf-8-sig")
    (folder / "labels" / "p0.txt").write_text("0 0.5 0.5 0.1 0.1\n", encoding="utf-8-sig")
    assert read_dataset(folder).classes == ("ship",)
    (folder / "classes.txt").unlink()
    (folder / "data.yaml").write_text("names: [ship]\n", encoding="utf-8-sig")
    assert read_dataset(folder).classes == ("ship",)


def test_numbered_classes_are_taken_by_number(folder):
    (folder / "classes.txt").unlink()
    (folder / "data.yaml").write_text("names:\n  1: boat\n  0: ship\n")
    assert read_dataset(folder).classes == ("ship", "boat")
    (folder / "data.yaml").write_text("names:\n  1: ship\n  2: boat\n")
    with pytest.raises(DataError, match=r"numbers its classes 1, 2; expected 0, 1"):
        read_dataset(folder)


def test_a_range_that_is_no_number_is_named(folder):
    (folder / "scenes.jsonl").write_text('{"file": "p0.jpg", "range_m": "far"}\n')
    with pytest.raises(DataError, match=r"scenes\.jsonl, line 1: .*range_m"):
        read_dataset(folder)
