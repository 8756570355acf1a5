"""Dataclasses from TOML: what is taken, what is refused and in which words, and how layers merge."""

import copy
import dataclasses
import enum
import math
from pathlib import Path
from typing import Literal

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings

from shipland.config import (
    at_scale,
    bounds_of,
    build,
    defaults,
    fields_of,
    key,
    merge,
    nested,
    packaged_toml,
    parameters,
    read_toml,
    require,
    scaled,
    setting,
    settings,
)
from shipland.errors import ConfigError, ShiplandError
from shipland.learning.evaluate import EvaluateParameters
from shipland.learning.settings import TrainParameters
from shipland.learning.shots import SynthParameters
from shipland.record.channels import LogParameters
from shipland.report.video import VideoParameters
from shipland.scenario.scenario import Scenario, load_scenario, scenario_table
from shipland.vehicles.anafi.setup import AnafiParameters
from shipland.vehicles.camera_stream import StreamParameters
from shipland.vehicles.checks import PreflightParameters
from shipland.vehicles.mavlink.parameters import MavlinkParameters
from shipland.vehicles.touchdown import TouchdownParameters


class Law(enum.Enum):
    LINEAR = "linear"
    EXPONENTIAL = "exponential"


@parameters
class Gain:
    k_p: float = key(..., ge=0)
    k_i: float = key(...)

    def __post_init__(self) -> None:
        require(self.k_i <= self.k_p, "k_i must not be above k_p")


@parameters
class Settings:
    pitch: Gain
    law: Law
    steps: int
    damped: bool
    name: str
    file: Path
    point_m: tuple[float, float, float]
    gains: tuple[Gain, ...]
    processing: Literal["paper", "zero"]
    limit: float | None
    margin_m: float = 0.5


@parameters
class NoKeys:
    pass


@parameters
class Bounded:
    a: float = key(1.0, "meaning", "[Lee2022]", gt=0)
    b: float = key(1.0, ge=0, lt=1)
    c: int = key(1, le=9)
    d: int = 1
    e: float | None = key(None, lt=2)


@parameters
class Nested:
    gain: Gain = key(Gain(2.0, 0.5), "of the loop")


def table(**changes):
    """A table that is right, but for `changes`."""
    return {
        "pitch": {"k_p": 7.5, "k_i": 0.05},
        "law": "exponential",
        "steps": 3,
        "damped": True,
        "name": "near",
        "file": "run.mcap",
        "point_m": [1, 2.0, 3.5],
        "gains": [{"k_p": 1, "k_i": 0}],
        "processing": "paper",
        "limit": 2,
    } | changes


class TestBuild:
    def test_every_kind_of_value_arrives_in_its_type(self):
        settings = build(Settings, table())
        assert settings == Settings(
            pitch=Gain(7.5, 0.05),
            law=Law.EXPONENTIAL,
            steps=3,
            damped=True,
            name="near",
            file=Path("run.mcap"),
            point_m=(1.0, 2.0, 3.5),
            gains=(Gain(1.0, 0.0),),
            processing="paper",
            limit=2.0,
            margin_m=0.5,
        )
        assert isinstance(settings.limit, float)
        assert isinstance(settings.gains[0].k_p, float)

    def test_a_key_with_a_default_may_be_given(self):
        assert build(Settings, table(margin_m=1)).margin_m == 1.0

    @pytest.mark.parametrize(
        ("key", "value", "fault"),
        [
            ("pitch", 7.5, r"s\.pitch: expected a table, got 7\.5"),
            ("pitch", {"k_p": 1.0}, r"s\.pitch: missing key 'k_i'"),
            ("pitch", {"k_p": "high", "k_i": 0}, r"s\.pitch\.k_p: expected float, got 'high'"),
            ("pitch", {"k_p": -1, "k_i": 0}, r"s\.pitch\.k_p: expected 0 or more, got -1$"),
            ("pitch", {"k_p": 1, "k_i": 2}, r"s\.pitch: k_i must not be above k_p$"),
            ("pitch", {"kp": 1, "k_i": 0}, r"s\.pitch: unknown key 'kp'; did you mean 'k_p'\?$"),
            ("law", "cubic", r"s\.law: 'cubic' is none of 'linear', 'exponential'"),
            ("law", 3, r"s\.law: 3 is none of 'linear', 'exponential'"),
            ("steps", 3.0, r"s\.steps: expected int, got 3\.0"),
            ("steps", True, r"s\.steps: expected int, got True"),
            ("steps", "3", r"s\.steps: expected int, got '3'"),
            ("steps", 2**63, r"s\.steps: expected a number of 64 bits, got 9223372036854775808"),
            ("damped", 1, r"s\.damped: expected bool, got 1"),
            ("name", 7, r"s\.name: expected str, got 7"),
            ("file", 7, r"s\.file: expected str, got 7"),
            ("point_m", 1.0, r"s\.point_m: expected a list, got 1\.0"),
            ("point_m", "123", r"s\.point_m: expected a list, got '123'"),
            ("point_m", [1, 2], r"s\.point_m: expected 3 values, got 2"),
            ("point_m", [1, 2, 3, 4], r"s\.point_m: expected 3 values, got 4"),
            ("point_m", [1, 2, math.nan], r"s\.point_m\[2\]: expected -1e\+09 to 1e\+09, got nan"),
            ("point_m", [1, True, 3], r"s\.point_m\[1\]: expected float, got True"),
            ("gains", [{"k_p": 1, "k_i": 0}, {"k_p": 1}], r"s\.gains\[1\]: missing key 'k_i'"),
            ("processing", "fast", r"s\.processing: 'fast' is none of 'paper', 'zero'"),
            ("limit", "none", r"s\.limit: expected float, got 'none'"),
            ("margin_m", math.inf, r"s\.margin_m: expected -1e\+09 to 1e\+09, got inf"),
            ("margin_m", -math.inf, r"s\.margin_m: expected -1e\+09 to 1e\+09, got -inf"),
            ("margin_m", math.nan, r"s\.margin_m: expected -1e\+09 to 1e\+09, got nan"),
            ("margin_m", 10**400, r"s\.margin_m: expected a number of 64 bits, got 1000"),
        ],
    )
    def test_wrong_values_are_refused_with_their_place(self, key, value, fault):
        with pytest.raises(ConfigError, match=fault):
            build(Settings, table(**{key: value}), "s")

    @pytest.mark.parametrize("key", [field.name for field in dataclasses.fields(Settings) if field.name != "margin_m"])
    def test_a_missing_key_is_named(self, key):
        lacking = table()
        del lacking[key]
        with pytest.raises(ConfigError, match=f"^s: missing key '{key}'$"):
            build(Settings, lacking, "s")

    @pytest.mark.parametrize(("key", "nearest"), [("stpes", "steps"), ("gain", "gains"), ("point", "point_m")])
    def test_an_unknown_key_is_refused_with_the_nearest_known_one(self, key, nearest):
        with pytest.raises(ConfigError, match=rf"^s: unknown key '{key}'; did you mean '{nearest}'\?$"):
            build(Settings, table(**{key: 1}), "s")

    def test_a_table_that_takes_no_keys_says_so(self):
        assert build(NoKeys, {}) == NoKeys()
        with pytest.raises(ConfigError, match="unknown key 'x'; it takes none"):
            build(NoKeys, {"x": 1})

    def test_something_other_than_a_table_is_refused(self):
        with pytest.raises(ConfigError, match="s: expected a table, got 3"):
            build(Settings, 3, "s")

    @hypothesis_settings(max_examples=20)
    @given(
        st.dictionaries(
            st.text(max_size=9),
            st.recursive(st.none() | st.booleans() | st.floats() | st.text(max_size=9), st.lists, max_leaves=4),
            max_size=9,
        )
    )
    def test_any_table_is_either_built_or_refused_in_the_family_of_errors(self, junk):
        with pytest.raises(ShiplandError):
            build(Settings, junk)


class TestParameters:
    def test_a_field_states_default_meaning_source_and_bounds(self):
        fields = fields_of(Settings)
        assert fields["margin_m"].default == 0.5 and not fields["name"].default_factory
        assert [bounds_of(fields_of(Bounded)[name]) for name in "abcde"] == [
            "more than 0",
            "0 to below 1",
            "9 or less",
            "",
            "less than 2",
        ]
        assert fields_of(Bounded)["a"].description == "meaning" and fields_of(Bounded)["a"].json_schema_extra == {
            "source": "[Lee2022]"
        }

    def test_a_table_is_laid_over_what_the_field_of_a_section_states(self):
        assert build(Nested, {"gain": {"k_i": 1}}).gain == Gain(2.0, 1.0)
        assert defaults(Nested) == {"gain": {"k_p": 2.0, "k_i": 0.5}}

    def test_values_are_checked_whenever_one_is_made(self):
        with pytest.raises(ValueError, match="greater than or equal to 0"):
            Gain(-1.0, 0.0)
        with pytest.raises(dataclasses.FrozenInstanceError):
            Gain(1.0, 0.0).k_p = 2.0


@parameters
class Sized:
    reach_m: float = scaled(2.0, "length", ge=0)
    pace_mps: float = scaled(1.0, "speed")
    turn_rad_s: float = scaled(0.5, "rate")
    brake_mps2: float = scaled(0.4, "acceleration")
    weight: float = scaled(1.0, "of a squared speed", power=1.0)
    steps_m: tuple[float, ...] = scaled((0.1, 0.3), "lengths")
    delay_s: float = key(0.3, "of a camera")


@parameters
class Holder:
    inner: Sized = key(Sized(reach_m=3.0))


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"wind": {5: 3.0}}, r"a key of \{'wind': \{5: 3\.0\}\} is no text; expected names"),
        ({"vision": None}, "configuration.vision: expected a table, got None"),
    ],
)
def test_overrides_of_a_wrong_type_are_one_clear_error(overrides, words):
    with pytest.raises(ConfigError, match=words):
        load_scenario("near", **overrides)


class TestScale:
    def test_froude(self):
        want = {"reach_m": 8.0, "pace_mps": 2.0, "turn_rad_s": 0.25, "brake_mps2": 0.4, "weight": 4.0}
        assert at_scale(Sized, 4.0) == want | {"steps_m": [0.4, 1.2], "delay_s": 0.3}
        assert at_scale(Holder, 4.0)["inner"]["reach_m"] == 12.0
        assert at_scale(Holder, 1.0) == defaults(Holder)

    def test_scale_one_changes_no_scenario_and_a_value_given_stays(self):
        assert at_scale(Scenario, 1.0) == defaults(Scenario)
        table = scenario_table("near", None, ["guidance.length_scale=1.5", "guidance.approach.hover_height_m=2"])
        approach = load_scenario(table).guidance.approach
        assert (approach.hover_height_m, approach.commit_height_m, approach.max_speed_mps) == (2.0, 1.05, 0.1837)
        assert load_scenario({"guidance": {"length_scale": 1.5}}).safety.monitor.near_m == 9.0

    @pytest.mark.parametrize("value", ["-1", "0", "1000", "huge", "true"])
    def test_a_wrong_scale_is_refused(self, value):
        with pytest.raises(ConfigError, match=r"guidance\.length_scale: expected"):
            load_scenario(scenario_table("near", None, [f"guidance.length_scale={value}"]))


keys = st.sampled_from(["a", "b", "c"])
tables = st.recursive(
    st.dictionaries(keys, st.integers()), lambda inner: st.dictionaries(keys, st.integers() | inner), max_leaves=8
)


class TestLayers:
    def test_tables_merge_key_by_key_and_everything_else_is_replaced(self):
        base = {"rig": {"deck_m": 1.0, "bar_m": 2.0}, "list": [1, 2], "name": "x"}
        overlay = {"rig": {"deck_m": 3.0}, "list": [9], "extra": {"k": 1}}
        before = copy.deepcopy((base, overlay))
        merged = {"rig": {"deck_m": 3.0, "bar_m": 2.0}, "list": [9], "name": "x", "extra": {"k": 1}}
        assert merge(base, overlay) == merged
        assert (base, overlay) == before

    @given(tables)
    def test_an_empty_layer_changes_nothing_and_a_layer_over_itself_is_itself(self, layer):
        assert merge(layer, {}) == layer
        assert merge({}, layer) == layer
        assert merge(layer, layer) == layer

    @given(tables, tables)
    def test_what_the_upper_layer_says_stands(self, base, overlay):
        merged = merge(base, overlay)
        assert merge(merged, overlay) == merged
        assert set(merged) == set(base) | set(overlay)


class TestFiles:
    @pytest.mark.parametrize("content", [b"[rig]\ndeck_m = 1.5\n", b"\xef\xbb\xbf[rig]\r\ndeck_m = 1.5\r\n"])
    def test_read_also_with_a_byte_order_mark_and_windows_line_ends(self, content, tmp_path):
        path = tmp_path / "a.toml"
        path.write_bytes(content)
        assert read_toml(path) == {"rig": {"deck_m": 1.5}}

    @pytest.mark.parametrize(
        ("content", "fault"),
        [
            (b"[rig\n", "is not valid TOML"),
            (b"a = 1\na = 2\n", "is not valid TOML"),
            (b"a = \xff\n", "cannot be read"),
            (b"a = " + b"[" * 100000, "is not valid TOML"),
            (b"\x00\x01\x02", "is not valid TOML"),
        ],
    )
    def test_broken_files_are_refused_with_their_name(self, tmp_path, content, fault):
        path = tmp_path / "a.toml"
        path.write_bytes(content)
        with pytest.raises(ConfigError, match=rf"a\.toml {fault}"):
            read_toml(path)

    def test_missing_file_and_folder(self, tmp_path):
        with pytest.raises(ConfigError, match=r"b\.toml does not exist"):
            read_toml(tmp_path / "b.toml")
        with pytest.raises(ConfigError, match="cannot be read"):
            read_toml(tmp_path)


class TestPackaged:
    def test_defaults_are_there(self):
        assert {"rig", "camera"} <= set(defaults(Scenario))
        assert set(packaged_toml("vehicles")) == {"response"}

    @pytest.mark.parametrize("name", ["vehcles", "", "vehicles.toml", "nowhere/near"])
    def test_an_unknown_name_lists_the_known_ones_and_an_unknown_folder_is_named(self, name):
        said = "no folder 'nowhere'" if "/" in name else f"no packaged configuration '{name}'; there are: vehicles"
        with pytest.raises(ConfigError, match=said):
            packaged_toml(name)


def test_require():
    require(True, "never said")
    with pytest.raises(ValueError, match=r"^the reason$"):
        require(False, "the reason")


class TestSettings:
    @pytest.mark.parametrize(
        ("text", "want"),
        [
            ("wind.mean_mps=5", ("wind.mean_mps", [5])),
            ("ship.motion=sea", ("ship.motion", ["sea"])),
            ("ship.motion = natops,sea", ("ship.motion", ["natops", "sea"])),
            ("wind.mean_mps=0,3,6.5", ("wind.mean_mps", [0, 3, 6.5])),
            ("vision.hue=[35, 85]", ("vision.hue", [[35, 85]])),
            ("vision.hue=[35, 85],[30, 90]", ("vision.hue", [[35, 85], [30, 90]])),
            ("scene.on=true", ("scene.on", [True])),
            ('a.path="x,y"', ("a.path", ["x,y"])),
            ("a.path=C[1", ("a.path", ["C[1"])),
            ("a.path=runs/a=b.csv", ("a.path", ["runs/a=b.csv"])),
        ],
    )
    def test_keys_and_values(self, text, want):
        assert setting(text) == want

    @pytest.mark.parametrize("text", ["wind", "=3", "wind..mean=3", "a b=3", "wind.mean_mps="])
    def test_what_is_no_setting_is_refused(self, text):
        with pytest.raises(ConfigError, match="--set"):
            setting(text)

    def test_several_make_one_table_and_the_last_counts(self):
        assert settings(["a.b=1", "a.c=2", "a.b=3"]) == {"a": {"b": 3, "c": 2}}

    def test_dotted_keys_nest(self):
        assert nested({"a.b": 1, "a": {"c.d": 2}}) == {"a": {"b": 1, "c": {"d": 2}}}


DEEP = ["=" + "[" * 2000, "=" + "[" * 40 + "]" * 40, "=" + "{a=" * 400 + "1" + "}" * 400, ".a" * 2000 + "=1"]


class TestHostile:
    @pytest.mark.parametrize("text", [*DEEP, "=" + "9" * 5000, "=0x" + "f" * 5000, "=1e999999"])
    def test_a_setting_of_any_text_is_one_short_line(self, text):
        with pytest.raises(ConfigError) as told:
            load_scenario(scenario_table("near", None, [f"wind.mean_mps{text}"] * 2))
        assert len(str(told.value)) < 300
        assert "\n" not in str(told.value)

    @pytest.mark.parametrize("text", [*DEEP, "=" + "9" * 5000])
    def test_a_file_of_any_text_is_one_line(self, text, tmp_path):
        path = tmp_path / "own.toml"
        path.write_text(f"[wind]\nmean_mps{text}\n")
        with pytest.raises(ConfigError, match=r"own\.toml is not valid TOML: |expected a number of 64 bits") as told:
            load_scenario(path)
        assert "\n" not in str(told.value)


def floats(values, section):
    return [(section, key) for key, value in values.items() if isinstance(value, float)]


NEAR = scenario_table("near")
GUARDS = {
    "vehicles": {
        "mavlink": MavlinkParameters,
        "anafi": AnafiParameters,
        "touchdown": TouchdownParameters,
        "preflight": PreflightParameters,
        "camera": StreamParameters,
    },
    "guidance.approach": "max_height_error_m max_speed_mps max_yaw_error_deg max_data_age_s gate_m abort_offset_m "
    "go_around_radius_m go_around_height_m go_around_percent go_around_s",
    "guidance.modes": "lost_s lost_box_s memory_s blind_landing_s",
    "guidance.horizon": "abort_offset_m position_std_max_m",
    "guidance.horizon.descent": "sink_mps final_descent_mps",
    "guidance.horizon.delayed": "velocity_gate picture_gate lag_s",
    "vision": "max_blur max_noise reprojection_px max_distance_m track_s track_climb_mps gimbal_noise_rad",
    "selector": "patience_s memory_s",
    "detector": "stale_s",
    "safety.cue_height": "gap_s patience_s",
    "aircraft.settings": "command_timeout_s",
}
OF_VEHICLES = [each for section, cls in GUARDS["vehicles"].items() for each in floats(defaults(cls), section)]
OTHERS = (LogParameters, VideoParameters, TrainParameters, SynthParameters, EvaluateParameters)
OF_SCENARIOS = [(section, key) for section, keys in GUARDS.items() if section != "vehicles" for key in keys.split()]


@pytest.mark.parametrize("cls", [*GUARDS["vehicles"].values(), *OTHERS])
def test_every_default_is_a_value_that_its_field_takes(cls):
    assert build(cls, {}) == cls()


class TestBounds:
    """What guards something cannot be switched off by a number without end."""

    @pytest.mark.parametrize(("section", "key"), OF_VEHICLES)
    def test_of_real_vehicles(self, section, key):
        for value in (1e300, 1e6, math.inf, math.nan, -1.0):
            with pytest.raises(ConfigError, match=rf"{key}: expected .+ to .+, got"):
                build(GUARDS["vehicles"][section], {key: value}, "vehicles")

    @pytest.mark.parametrize(("section", "key"), OF_SCENARIOS)
    def test_of_a_flight(self, section, key):
        for text in ("1e300", "1e6", "inf", "nan"):
            with pytest.raises(ConfigError, match=rf"{key}: expected .+ to .+, got"):
                load_scenario(merge(NEAR, settings([f"{section}.{key}={text}"])))

    def test_no_number_of_a_flight_is_beyond_all_bounds(self):
        def numbers(values, where=""):
            for name, value in values.items():
                if isinstance(value, dict):
                    yield from numbers(value, f"{where}{name}.")
                elif isinstance(value, float):
                    yield f"{where}{name}"

        names = list(numbers(NEAR))
        assert len(names) > 500
        for name in names[::30]:
            for text in ("1e300", "-1e300"):
                with pytest.raises(ConfigError):
                    load_scenario(merge(NEAR, settings([f"{name}={text}"])))


@pytest.mark.parametrize("given", [np.int64(3), np.float32(3.0), np.array(3.0)])
def test_numpys_numbers_are_numbers(given):
    assert load_scenario("near", **{"wind.mean_mps": given}).wind.mean_mps == 3.0
    with pytest.raises(ConfigError, match=r"expected float, got \[3"):
        load_scenario("near", **{"wind.mean_mps": np.array([3.0, 4.0])})
