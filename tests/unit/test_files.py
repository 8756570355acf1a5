"""Files: damage is known by a digest, text and JSON of any content end in one line."""

import hashlib
import json
import shutil
from pathlib import Path

import pytest

import shipland
from shipland.errors import DataError
from shipland.files import DIGESTS, check_digest, json_of, read_text, write_with_digest
from shipland.guidance.horizon.learned import LearnedSteering
from shipland.guidance.response import ANAFI_LIKE
from shipland.vision.far.layouts import load_reader

WEIGHTS = Path(shipland.__file__).parent / "weights"
SHIPPED = sorted(WEIGHTS.rglob("*.onnx"))


def load(path):
    """As a flight does."""
    if path.parent.name == "policies":
        return LearnedSteering(str(path), "direct" if path.stem == "direct" else "residual", ANAFI_LIKE)
    return load_reader(path)


def test_every_shipped_network_is_listed_with_its_digest():
    assert len(SHIPPED) >= 6
    for path in SHIPPED:
        listed = dict(reversed(line.split("  ")) for line in (path.parent / DIGESTS).read_text().splitlines())
        assert listed[path.name] == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("source", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_network_with_one_bit_turned_is_refused(source, tmp_path, rng):
    folder = tmp_path / source.parent.name
    shutil.copytree(source.parent, folder, ignore=lambda *_: [it.name for it in SHIPPED if it != source])
    path, whole = folder / source.name, source.read_bytes()
    for _ in range(10 if len(whole) < 1e6 else 3):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        with pytest.raises(DataError, match=rf"{source.name} is damaged: its SHA-256 is .*; copy it again"):
            load(path)


def test_what_is_written_with_its_digest_is_known_when_it_changes(tmp_path):
    path, other = tmp_path / "detector.onnx", tmp_path / "detector-int8.onnx"
    write_with_digest(path, b"first")
    write_with_digest(other, b"other")
    write_with_digest(path, b"second")
    check_digest(path)
    check_digest(other)
    path.write_bytes(b"changed")
    with pytest.raises(DataError, match=r"detector\.onnx is damaged.*take its line out of SHA256SUMS"):
        check_digest(path)
    (tmp_path / DIGESTS).unlink()  # without a digest it is taken as it is
    check_digest(path)


def test_a_list_of_digests_that_is_none_names_its_line(tmp_path):
    (tmp_path / DIGESTS).write_text("no digest  detector.onnx\n")
    with pytest.raises(DataError, match="SHA256SUMS, line 1: expected a SHA-256 and a file name"):
        check_digest(tmp_path / "detector.onnx")


def test_a_digest_is_asked_for_again_only_after_a_change(tmp_path, monkeypatch):
    path, read = tmp_path / "detector.onnx", []
    write_with_digest(path, b"weights")
    whole = hashlib.file_digest
    monkeypatch.setattr(hashlib, "file_digest", lambda *given: read.append(given) or whole(*given))
    for _ in range(3):
        check_digest(path)
    assert len(read) == 1


def test_text_in_another_encoding_is_one_line(tmp_path):
    path = tmp_path / "classes.txt"
    path.write_bytes("Brücke".encode("latin-1"))
    with pytest.raises(DataError, match=r"classes\.txt is not text in UTF-8 \(byte 2 is 0xfc\)"):
        read_text(path)


@pytest.mark.parametrize("text", ["[" * 100_000, "[" * 40 + "]" * 40, "1" * 5000, '{"a": ', b"\xff"])
def test_json_of_any_kind_is_a_value_or_a_value_error(text):
    with pytest.raises(ValueError, match=r"\w"):
        json_of(text)
    table = {"a": [1, 2.5, {"b": None}]}
    assert json_of(json.dumps(table)) == table
