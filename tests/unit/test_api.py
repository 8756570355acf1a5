"""`import shipland`: light, and what it gives is what the command line gives."""

import base64
import json
import re
import signal
import typing
from dataclasses import replace

import cv2
import numpy as np
import pytest

import shipland
from shipland.errors import ConfigError
from shipland.guidance.pilot import paper
from shipland.record.info import config_digest
from shipland.record.reader import read_log
from shipland.report.palette import BLUE
from shipland.scenario.autonomy import build_vehicle
from shipland.scenario.fly import flight_info
from shipland.scenario.scenario import load_scenario
from shipland.vehicles.simulated import SimulatedVehicle

SHORT = {"time_limit_s": 2.0}


def test_what_the_package_gives_is_listed_and_nothing_else():
    assert set(shipland.__all__) <= set(dir(shipland))
    with pytest.raises(AttributeError, match="load_scenario"):
        _ = shipland.no_such_thing


@pytest.mark.parametrize("name", ["fly", "campaign", "see"])
def test_the_types_of_its_arguments_can_be_asked(name):
    assert typing.get_type_hints(getattr(shipland, name))["return"]


def test_a_flight_gives_arrays():
    flight = shipland.fly(shipland.load_scenario("near", **SHORT), pilot=paper, seed=3)
    table = flight.table()
    assert len(table["t_s"]) == len(flight.records) == len(flight.columns.t_s) > 20
    assert table["truth_in_pad_m_2"] == pytest.approx(flight.columns.truth_in_pad_m[:, 2])
    assert not flight.success
    assert repr(flight).startswith("<Flight of near: no touchdown: ")
    assert len(repr(flight)) < 200
    assert np.isnan(flight.error_m)
    assert "time limit" in flight.reason
    assert all(record.frame.image is None for record in flight.records)


def test_a_notebook_shows_verdict_figures_the_whole_flight_and_its_film(monkeypatch, tmp_path):
    flight = shipland.fly("near", seed=3)
    shown = flight._repr_html_()
    assert shown.startswith(f"<b>near: {flight.reason}</b>")
    assert f"<td>{flight.error_m:.3f} m</td>" in shown
    picture = base64.b64decode(re.search('src="data:image/png;base64,([^"]+)"', shown).group(1))
    image = cv2.cvtColor(cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    columns = np.argwhere((np.abs(image.astype(int) - BLUE) < 40).all(axis=2))[:, 1]
    assert columns.min() < 60  # the trail begins at the left border, and ends on the deck
    assert columns.max() > 400
    assert len(shown) < 200_000
    short = shipland.fly(shipland.load_scenario("near", **SHORT), seed=3)
    assert "no touchdown" in short._repr_html_()
    filmed = replace(short, folder=tmp_path)
    assert "<video" not in filmed._repr_html_()
    (tmp_path / "flight.mp4").touch()
    assert f'src="{tmp_path / "flight.mp4"}"></video>' in filmed._repr_html_()
    monkeypatch.chdir(tmp_path.parent)  # where the notebook lies: a server shows no file by its absolute path
    assert f'src="{tmp_path.name}/flight.mp4"></video>' in filmed._repr_html_()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"vision": None}, r"None is none of the visions; expected a name \(geometric, published, rendered\)"),
        ({"pilot": ["paper"]}, "none of the pilots"),
        ({"seed": None}, "a seed must be a whole number, got None"),
        ({"seed": 1.5}, "a seed must be a whole number"),
        ({"seed": -1}, "a seed must be 0 or more, got -1"),
        ({"on_cycle": None}, "on_cycle must be a function, got None"),
        ({"override": None}, "override must be a function, got None"),
    ],
)
def test_an_argument_of_no_use_is_refused_in_words(wrong, words):
    with pytest.raises(ConfigError, match=words):
        shipland.fly("near", **wrong)


def test_a_seed_may_be_numpys(without_plots, tmp_path):
    flight = shipland.fly(shipland.load_scenario("near", **SHORT), seed=np.int64(3), out=tmp_path, video=False)
    plain = shipland.fly(shipland.load_scenario("near", **SHORT), seed=3)
    assert flight.columns.sticks_percent.tolist() == plain.columns.sticks_percent.tolist()
    assert read_log(tmp_path / "flight.mcap").header.info.seed == 3


class Swallowing:
    """A pilot in whose third decision Ctrl-C comes, which code of C makes another error of."""

    def __init__(self, setup):
        self._pilot, self.decisions = paper(setup), 0

    def decide(self, observation, telemetry, sent):
        self.decisions += 1
        if self.decisions == 3:
            try:
                signal.getsignal(signal.SIGINT)(signal.SIGINT, None)
            except KeyboardInterrupt as interrupt:
                raise SystemError("returned a result with an exception set") from interrupt
        return self._pilot.decide(observation, telemetry, sent)


def test_ctrl_c_ends_a_flight_at_the_next_cycle_wherever_it_falls(without_plots, tmp_path):
    pilots = []

    def swallowing(setup):
        pilots.append(Swallowing(setup))
        return pilots[-1]

    with pytest.raises(KeyboardInterrupt):
        shipland.fly(shipland.load_scenario("near", **SHORT), pilot=swallowing, out=tmp_path, video=False)
    assert pilots[0].decisions == 3
    log = read_log(tmp_path / "flight.mcap")
    assert log.complete
    assert len(log.records) == 3


def test_a_log_and_its_summary_say_what_was_flown(without_plots, tmp_path):
    scenario = shipland.load_scenario("near", **SHORT, wind={"mean_mps": 1.5})
    shipland.fly(scenario, seed=3, out=tmp_path, video=False, command="shipland fly --seed 3")
    info = read_log(tmp_path / "flight.mcap").header.info
    assert load_scenario(json.loads(info.configuration)) == scenario
    assert config_digest(json.loads(info.configuration)) == info.config_digest
    assert (info.pilot, info.vision, info.command) == ("horizon", "geometric", "shipland fly --seed 3")
    assert info.code_version.startswith(shipland.__version__)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert load_scenario(summary["configuration"]) == scenario
    assert summary["command"] == "shipland fly --seed 3"


def test_weights_are_written_down_where_they_fly():
    scenario = load_scenario("near")
    assert flight_info(scenario, "paper", "geometric", 1).weights_digest == ""
    assert len(flight_info(scenario, "paper", "rendered", 1).weights_digest) == 16


class Told(SimulatedVehicle):
    """Tells others, in vain."""

    def inform_of(self, rig, camera_in_body_m):
        assert camera_in_body_m.shape == (3,)
        assert rig.deck_in_bar_m.shape == (3,)

    def inform(self, record):
        raise OSError("the line is down")


def test_what_telling_others_raises_is_logged_once_and_the_flight_goes_on(caplog):
    scenario = load_scenario("near", **SHORT)
    vehicle = build_vehicle(scenario, 3, None)
    vehicle.__class__ = Told
    told = shipland.fly(scenario, seed=3, vehicle=vehicle)
    assert len(told.records) == len(shipland.fly(scenario, seed=3).records)
    assert caplog.text.count("nobody was told") == 1
