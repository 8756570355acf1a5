import csv
import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from shipland.errors import ConfigError, DataError
from shipland.report.motion import Sampling, report_case, report_headings, sample, statistics
from shipland.scenario.scenario import Scenario, load_scenario
from shipland.sim.ship.deck_motion import DOF_NAMES
from shipland.sim.ship.recorded import HEADER


def case(**changes: object) -> Scenario:
    return load_scenario("near", **{"wind.mean_mps": 0.0, "wind.mean_half_range_mps": 0.0} | changes)


def test_statistics_of_natops_are_those_of_sines() -> None:
    stats = dict(zip(DOF_NAMES, statistics(case(), 1, 1000.0), strict=True))
    # twice the standard deviation of a sine is √2 of its amplitude; 1000 s hold 99 rolls and 153 pitches
    assert stats["roll"].significant == pytest.approx(np.sqrt(2) * 8.0, rel=0.01)
    assert stats["roll"].period_s == pytest.approx(10.1, abs=0.05)
    assert stats["pitch"].period_s == pytest.approx(6.5, abs=0.05)
    assert stats["roll"].largest == pytest.approx(8.0, abs=0.05)
    assert stats["heave"].significant == 0.0
    assert np.isnan(stats["heave"].period_s)


def test_a_case_leaves_table_series_and_figure(tmp_path: Path) -> None:
    said = io.StringIO()
    blowing = case(
        **{"ship.motion": "sea", "wind.mean_mps": 5.0, "wind.from_half_range_deg": 0.0, "ship.course.kind": "s"}
    )
    report_case(blowing, Sampling(20.0, 100.0), tmp_path, Console(file=said, width=120))
    for name in DOF_NAMES:
        assert name in said.getvalue()
    assert (tmp_path / "motion.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "wind.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 401
    assert np.mean([float(row["wind_north_mps"]) for row in rows]) < -1.0
    with (tmp_path / "motion_table.csv").open() as file:
        assert [row["motion"] for row in csv.DictReader(file)] == list(DOF_NAMES)


def test_the_written_motion_can_be_flown_again(unarranged: None, tmp_path: Path) -> None:
    sea = case(**{"ship.motion": "sea"})
    report_case(sea, Sampling(20.0, 20.0), tmp_path, Console(file=io.StringIO()))
    path = tmp_path / "motion.csv"
    assert path.read_text().splitlines()[0] == ",".join(HEADER)
    original = sample(sea, 1, 10.0, 0.1).deck
    again = sample(case(**{"ship.motion": "recorded", "ship.recorded.path": str(path)}), 1, 10.0, 0.1).deck
    # six digits in the file and a cubic spline through 20 points a second
    np.testing.assert_allclose(again, original, atol=1e-3)


def test_both_headings_and_both_time_rules(tmp_path: Path) -> None:
    report_headings(case(**{"ship.motion": "sea"}), Sampling(20.0, 200.0), tmp_path, Console(file=io.StringIO()))
    with (tmp_path / "motion_headings.csv").open() as file:
        rows = list(csv.DictReader(file))
    cases = list(dict.fromkeys(row["case"] for row in rows))
    assert len(cases) == 4
    assert len(rows) == 24
    period = {(row["case"], row["motion"]): float(row["mean_period_s"]) for row in rows}
    for heading in ("60° off the bow", "60° off the stern"):
        ratio = period[f"{heading}, length_only", "roll"] / period[f"{heading}, froude", "roll"]
        assert ratio == pytest.approx(np.sqrt(8.33), rel=0.15)  # 200 s hold some 20 slow rolls
    assert (tmp_path / "motion_headings.png").stat().st_size > 10_000


def test_a_motion_slower_than_its_record_is_no_standstill(unarranged: None, tmp_path: Path) -> None:
    said, slow = io.StringIO(), {"amplitude_m_deg": [0, 0, 0.3, 0, 0, 0], "period_s": [60.0] * 6}
    swell = case(**{"ship.motion": "sinusoids", "ship.sinusoids": slow})
    report_case(swell, Sampling(10.0, 30.0), tmp_path, Console(file=said, width=120))
    rows = {
        line.split(",")[0].strip(" │"): line.split("│")[2].strip()
        for line in said.getvalue().splitlines()
        if "│" in line
    }
    assert float(rows["heave"].split(" / ")[0]) > 0.1
    assert rows["sway"] == "0"


def test_a_seed_gives_the_same_series() -> None:
    blowing = case(**{"ship.motion": "sea", "wind.mean_mps": 4.0})
    one, same, other = (sample(blowing, seed, 10.0, 0.5) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.deck, same.deck)
    np.testing.assert_array_equal(one.wind_in_ned_mps, same.wind_in_ned_mps)
    assert np.abs(one.deck - other.deck).max() > 0.1


def test_bad_lengths_of_record_are_refused() -> None:
    with pytest.raises(ConfigError, match="duration_s must be in 10…36000 s"):
        Sampling(duration_s=1.0)


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(DataError, match="cannot be written"):
        report_case(case(), Sampling(10.0, 10.0), blocked, Console(file=io.StringIO()))
