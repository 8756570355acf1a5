"""What is held out of training has no near twin among the rest, and where it may have, that is said."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from PIL import Image

from shipland.errors import DataError
from shipland.learning.dataset import Dataset, Sample
from shipland.learning.split import split

NOTHING = np.zeros((0, 5), np.float32)


def picture(seed):
    """Coarse blotches: pictures of two seeds are as unlike as any."""
    rng = np.random.default_rng(seed)
    return cv2.resize(rng.integers(0, 256, (8, 9, 3), dtype=np.uint8), (90, 64), interpolation=cv2.INTER_CUBIC)


@pytest.fixture
def make(tmp_path):
    """A set of pictures of these names; each drawn from its number, or from what `like` says."""

    def made(names, like=None, scene=None):
        samples = []
        for number, name in enumerate(names):
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(path), picture(number if like is None else like(number)))
            samples.append(Sample(path, NOTHING, scene or {}))
        return Dataset(tmp_path, ("ship",), tuple(samples))

    return made


def names_of(dataset):
    return [sample.path.name for sample in dataset.samples]


def test_a_split_is_a_partition_that_the_seed_decides(make):
    dataset = make([f"p{number}.png" for number in range(10)])
    parts = split(dataset, 0.2, 5)
    assert len(parts.held_out.samples) == 2
    assert sorted(names_of(parts.fitting) + names_of(parts.held_out)) == names_of(dataset)
    assert names_of(split(dataset, 0.2, 5).held_out) == names_of(parts.held_out)
    assert any(names_of(split(dataset, 0.2, seed).held_out) != names_of(parts.held_out) for seed in range(5))
    with pytest.raises(DataError, match="splitting off a part needs two"):
        split(replace(dataset, samples=dataset.samples[:1]), 0.2, 5)


def test_frames_of_one_burst_are_held_out_together(make):
    """Forty frames of four bursts, ten wanted: one burst, which no other picture is of."""
    parts = split(make([f"{burst}_{number}.png" for burst in "abcd" for number in range(1, 11)]), 0.25, 3)
    assert (len(parts.fitting.samples), len(parts.held_out.samples)) == (30, 10)
    assert len({name[0] for name in names_of(parts.held_out)}) == 1
    assert (parts.how, parts.warning) == ("whole sequences, of 4", "")


@pytest.mark.parametrize("form", ["IMG_{}_1200{:02d}.png", "{}/f{:02d}.png", "DJI_{}1200{:02d}_0001.png"])
def test_days_are_told_by_name_or_folder(make, form):
    days = ("20240501", "20240502", "20240611")
    parts = split(make([form.format(day, number) for day in days for number in range(6)]), 0.3, 1)
    held = {next(day for day in days if day in str(sample.path)) for sample in parts.held_out.samples}
    rest = {next(day for day in days if day in str(sample.path)) for sample in parts.fitting.samples}
    assert len(held) == 1 and not held & rest
    assert parts.warning == ""


def test_folders_tell_days_where_names_do_not(make):
    parts = split(make([f"{day}/{number * 7919 % 1000:03d}x.png" for day in "abc" for number in range(5)]), 0.3, 1)
    assert len({sample.path.parent for sample in parts.held_out.samples}) == 1
    assert (len(parts.held_out.samples), parts.how, parts.warning) == (5, "whole folders, of 3", "")


def test_a_large_sequence_beside_a_small_one_gives_a_stretch(make):
    """One odd picture is too few for a score: four of the long sequence are held out, with the warning."""
    parts = split(make(["odd_1.png", *(f"film_{number}.png" for number in range(19))]), 0.2, 1)
    assert {name[:4] for name in names_of(parts.held_out)} == {"film"}
    assert (len(parts.held_out.samples), "flatters much" in parts.warning) == (4, True)


def test_days_are_told_by_exif_data(make):
    dataset = make([f"a{number:02d}.jpg" for number in range(12)])
    for number, sample in enumerate(dataset.samples):
        exif = Image.Exif()
        exif.get_ifd(0x8769)[0x9003] = f"2024:05:{1 + number % 2:02d} 10:00:{number:02d}"
        Image.open(sample.path).copy().save(sample.path, exif=exif)
    parts = split(dataset, 0.2, 1)
    assert len({int(name[1:3]) % 2 for name in names_of(parts.held_out)}) == 1
    assert (len(parts.held_out.samples), parts.how, parts.warning) == (6, "whole days, of 2", "")


def test_like_pictures_are_on_one_side_whatever_their_names(make):
    """Names that say nothing, pictures in five groups of four: none is torn, and the warning is given all the same."""
    dataset = make([f"{number * 7919 % 1000:03d}.png" for number in range(20)], like=lambda number: number // 4)
    parts = split(dataset, 0.2, 2)
    assert sorted(np.bincount([dataset.samples.index(sample) // 4 for sample in parts.held_out.samples]))[-1] == 4
    assert (len(parts.held_out.samples), parts.how) == (4, "whole groups of like pictures, of 5")
    assert "do not tell one day" in parts.warning
    # A twin under another burst's name joins the two bursts.
    twins = make([f"{burst}_{number}.png" for burst in "abcd" for number in range(5)], lambda n: 3 if n == 17 else n)
    for seed in range(4):
        held = {name[0] for name in names_of(split(twins, 0.25, seed).held_out)}
        assert "a" not in held and "d" not in held


def test_of_one_sequence_a_stretch_is_held_out_with_a_warning(make):
    """Twenty like frames: successive ones by number, not by spelling; its ends alone have neighbours."""
    parts = split(make([f"film_{number}.png" for number in range(20)], like=lambda _: 1), 0.25, 3)
    numbers = sorted(int(name[5:-4]) for name in names_of(parts.held_out))
    assert numbers == list(range(numbers[0], numbers[0] + 5))
    assert "flatters much" in parts.warning


def test_drawn_pictures_need_no_days(make):
    parts = split(make([f"ship-1-{number:06d}.png" for number in range(20)], scene={"range_m": 9.0}), 0.2, 3)
    assert (len(parts.held_out.samples), parts.warning) == (4, "")


def test_something_is_always_left_to_train_on(make):
    """Days of 6, 4 and 4 pictures, nine wanted: two days may be held out, all three may not."""
    days = [f"2024050{day}_{number}.png" for day, count in ((1, 6), (2, 4), (3, 4)) for number in range(count)]
    assert all(split(make(days), 0.7, seed).fitting.samples for seed in range(6))
