"""`[mavlink]`, and the limits that the vehicle's own parameters set."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from shipland.config import build, key, parameters, require
from shipland.errors import VehicleError
from shipland.guidance.response import Response
from shipland.vehicles.mavlink.state import ARDUPILOT, PX4, STICK_NAMES
from shipland.vehicles.parameters import SetpointParameters, measured
from shipland.vehicles.priority import First


@parameters
class MavlinkParameters(SetpointParameters):
    """`[mavlink]`."""

    kind: Literal["attitude", "velocity"] = key(
        "attitude",
        "what pitch and roll sticks mean",
        "attitude: tilts (ArduPilot) | velocity: speeds over ground (PX4)",
    )
    system_id: int = key(245, "ours", "chosen: not a ground station's 255, whose failsafe stays its own", ge=1, le=255)
    component_id: int = key(191, "ours", "MAV_COMP_ID_ONBOARD_COMPUTER", ge=1, le=255)
    setpoint_gap_s: float = key(
        0.3,
        "without a set-point for so long, the guard process of the link sends holds in our place; after "
        "`link_timeout_s` it asks for a mode that holds",
        "chosen: fifteen set-points; a PX4 waits 1 s (COM_OF_LOSS_T), an ArduPilot 3 s (GUID_TIMEOUT)",
        ge=0.05,
        le=2,
    )
    goes_first: First = key(
        "thread", "before other processes, with CAP_SYS_NICE", "thread: of the set-points | process: all of ours"
    )
    stick_takeover_us: int = key(80, "a stick moved by more takes over", "chosen: a sixth of full stick", ge=20, le=400)
    hover_throttle: float = key(
        0.35, "where the vehicle does not say", "chosen (MOT_THST_HOVER, MPC_THR_HOVER)", ge=0.05, le=0.95
    )
    force_disarm: bool = key(
        True, "a touchdown stops the motors at contact height", "an ArduPilot neither notices nor disarms itself"
    )
    disarm_retry_s: float = key(0.5, "from one attempt to the next", ge=0.1, le=10)

    def __post_init__(self) -> None:
        require(
            self.setpoint_gap_s > 1.0 / self.setpoint_hz,
            f"setpoint_gap_s must be above the {1.0 / self.setpoint_hz:g} s of setpoint_hz, got {self.setpoint_gap_s}",
        )


ARDUPILOT_NAMES = (
    "ANGLE_MAX", "ATC_ANGLE_MAX", "WPNAV_SPEED", "WPNAV_SPEED_UP", "WPNAV_SPEED_DN", "WP_SPD", "WP_SPD_UP", "WP_SPD_DN",
    "GUID_OPTIONS", "GUID_TIMEOUT", "MOT_THST_HOVER", "FENCE_ENABLE", "FENCE_ACTION", "EK3_SRC1_VELXY",
    "FS_THR_ENABLE", "FS_THR_VALUE",
    *STICK_NAMES[ARDUPILOT],
)  # fmt: skip
"""Read from an ArduPilot; newer ones have other names, in degrees and metres instead of hundredths."""

_PX4_FENCE_SIZES = ("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST")
"""Of the fence about home [m]; 0 is none."""
_PX4_NO_FENCE = "WARNING: none is set by GF_MAX_HOR_DIST or GF_MAX_VER_DIST: it is off unless one was drawn"

_PX4_LOSSES, _STOPS_MOTORS = ("NAV_RCL_ACT", "NAV_DLL_ACT"), (5, 6)
"""What it does without its transmitter, and without a ground station; values that end in the air: terminate, disarm."""

PX4_NAMES = (
    "MPC_TILTMAX_AIR", "MPC_XY_VEL_MAX", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN", "MPC_THR_HOVER", "COM_OF_LOSS_T",
    "COM_OBL_RC_ACT", "COM_RC_IN_MODE", "GF_ACTION", *_PX4_FENCE_SIZES, "EKF2_GPS_CTRL",
    *_PX4_LOSSES, *STICK_NAMES[PX4],
)  # fmt: skip
"""Read from a PX4."""

_REQUIRED = {
    ARDUPILOT: (
        ("GUID_OPTIONS",), ("ANGLE_MAX", "ATC_ANGLE_MAX"), ("WPNAV_SPEED_UP", "WP_SPD_UP"),
        ("WPNAV_SPEED_DN", "WP_SPD_DN"),
    ),
    PX4: (("MPC_TILTMAX_AIR",), ("MPC_XY_VEL_MAX",), ("MPC_Z_VEL_MAX_UP",), ("MPC_Z_VEL_MAX_DN",)),
}  # fmt: skip
"""One parameter of each group must be reported: nothing is assumed of what sticks mean."""

_UNFLOWN_OPTIONS = {
    3: "makes thrust raw thrust, and climb rates are needed",
    5: "lets the vehicle drift at a commanded velocity of zero, which is our hold",
}
"""GUID_OPTIONS that are not flown with, by their bits."""
_HOLDING_ACTIONS, _HOLDING_ALONE = (0, 1, 5), (5,)
"""COM_OBL_RC_ACT: POSITION, ALTITUDE, HOLD; the first two are NAV_RCL_ACT's action, or none, without a transmitter."""
_STICKS_IGNORED = (1, 4)
"""COM_RC_IN_MODE: MAVLink only, none."""
_OTHER_ACTIONS = {
    0: "waits for sticks that it does not obey", 1: "waits for sticks that it does not obey",
    2: "obeys the sticks alone", 3: "returns", 4: "lands", 6: "stops its motors", 7: "stops its motors",
}  # fmt: skip
_PX4_NO_FENCES = {0: "off", 1: "only warns", 4: "stops the motors in the air"}
"""GF_ACTION, where that is no fence that keeps the vehicle flying."""

_OPTICAL_FLOW = 5
"""EK3_SRC1_VELXY: horizontal velocity from optical flow."""


def missing_parameters(autopilot: int, values: Mapping[str, float]) -> list[str]:
    """Required parameters that the vehicle has not reported, under their usual names."""
    return [group[0] for group in _REQUIRED[autopilot] if not any(name in values for name in group)]


def changed_parameters(autopilot: int, told: Mapping[str, float], now: Mapping[str, float]) -> str:
    """Which required parameters are no longer as told, in words; empty while all are.

    >>> changed_parameters(ARDUPILOT, {"GUID_OPTIONS": 0.0}, {"GUID_OPTIONS": 8.0})
    'GUID_OPTIONS from 0 to 8'
    """
    names = (name for group in _REQUIRED[autopilot] for name in group if name in told)
    return ", ".join(f"{it} from {told[it]:g} to {now[it]:g}" for it in names if now.get(it, told[it]) != told[it])


@dataclass(frozen=True)
class VehicleLimits:
    """What the vehicle's parameters allow.

    Attributes:
        tilt_rad, speed_mps, up_mps, down_mps: largest; an ArduPilot's speed is infinite where it does not say.
        hover_throttle: 0 … 1; None where it does not say.
        fence_problem: why its own geofence keeps it from nothing, in words; empty where it does.
        fence_words: what is known of the fence where it has no such problem.
        hold_after_s: after the last set-point it acts by itself; NaN where it does not say.
        hold_problem: what it does then other than hold, in words; empty where it holds.
        hold_problem_alone: the same where there is no transmitter that it obeys.
        obeys_sticks: of a transmitter.
        stops_motors: failsafes by which it stops its motors in the air, in words; empty where none does.
        velocity_reference: of its estimate of velocity, as in `Response`.
    """

    tilt_rad: float
    speed_mps: float
    up_mps: float
    down_mps: float
    hover_throttle: float | None
    fence_problem: str
    hold_after_s: float
    hold_problem: str = ""
    hold_problem_alone: str = ""
    obeys_sticks: bool = True
    fence_words: str = "on"
    stops_motors: str = ""
    velocity_reference: Literal["ground", "surface"] = "ground"

    @staticmethod
    def of(autopilot: int, values: Mapping[str, float]) -> VehicleLimits:
        """The limits that parameters set.

        Raises:
            VehicleError: a required parameter was not reported, or one turns thrust from a climb rate into raw thrust.
        """
        if missing := missing_parameters(autopilot, values):
            raise VehicleError(
                f"the vehicle does not tell {', '.join(missing)}: without them the meaning of full sticks is unknown; "
                "try again where the link loses messages, and see that the firmware has them"
            )
        if autopilot == PX4:
            no_fence = _PX4_NO_FENCES.get(int(values.get("GF_ACTION", 0.0)))
            return VehicleLimits(
                tilt_rad=math.radians(values["MPC_TILTMAX_AIR"]),
                speed_mps=values["MPC_XY_VEL_MAX"],
                up_mps=values["MPC_Z_VEL_MAX_UP"],
                down_mps=values["MPC_Z_VEL_MAX_DN"],
                hover_throttle=values.get("MPC_THR_HOVER"),
                fence_problem=f"{no_fence}: set GF_ACTION to 2, 3 or 5" if no_fence else "",
                hold_after_s=values.get("COM_OF_LOSS_T", math.nan),
                hold_problem=_hold_problem(values.get("COM_OBL_RC_ACT"), _HOLDING_ACTIONS),
                hold_problem_alone=_hold_problem(values.get("COM_OBL_RC_ACT"), _HOLDING_ALONE),
                obeys_sticks=values.get("COM_RC_IN_MODE") not in _STICKS_IGNORED,
                fence_words="on" if any(values.get(name, 0.0) > 0.0 for name in _PX4_FENCE_SIZES) else _PX4_NO_FENCE,
                stops_motors=", ".join(
                    f"{name} is {values[name]:g}" for name in _PX4_LOSSES if values.get(name) in _STOPS_MOTORS
                ),
                velocity_reference="ground" if values.get("EKF2_GPS_CTRL", 1.0) > 0.0 else "surface",
            )
        for bit, words in _UNFLOWN_OPTIONS.items():
            if int(values["GUID_OPTIONS"]) >> bit & 1:
                raise VehicleError(f"GUID_OPTIONS {words} (bit {bit}): clear that bit on the vehicle")

        def either(hundredths: str, units: str) -> float:
            return 0.01 * values[hundredths] if hundredths in values else values.get(units, math.inf)

        hover = values.get("MOT_THST_HOVER")
        return VehicleLimits(
            tilt_rad=math.radians(either("ANGLE_MAX", "ATC_ANGLE_MAX")),
            speed_mps=either("WPNAV_SPEED", "WP_SPD"),
            up_mps=either("WPNAV_SPEED_UP", "WP_SPD_UP"),
            down_mps=abs(either("WPNAV_SPEED_DN", "WP_SPD_DN")),
            hover_throttle=hover if hover is not None and 0.05 < hover < 0.95 else None,
            fence_problem=_ardupilot_fence(values),
            hold_after_s=values.get("GUID_TIMEOUT", math.nan),
            velocity_reference="surface" if values.get("EK3_SRC1_VELXY") == _OPTICAL_FLOW else "ground",
        )


def _hold_problem(action: float | None, holding: tuple[int, ...]) -> str:
    """What a PX4 does without set-points, in words; empty where that is among the actions by which it holds."""
    if action is None:
        return "it does not tell COM_OBL_RC_ACT: what it does then is unknown"
    if action in holding:
        return ""
    words = _OTHER_ACTIONS.get(int(action), "does what is not known here")
    return f"it {words} then: set COM_OBL_RC_ACT to 5 (hold)"


def _ardupilot_fence(values: Mapping[str, float]) -> str:
    """Why the fence keeps the vehicle from nothing, in words."""
    if not values.get("FENCE_ENABLE", 0.0) > 0.0:
        return "off: set FENCE_ENABLE = 1"
    return "only reports: set FENCE_ACTION above 0" if values.get("FENCE_ACTION") == 0.0 else ""


def response_within(
    parameters: MavlinkParameters, limits: VehicleLimits, autopilot: int, table: Mapping[str, object]
) -> Response:
    """What full sticks mean: the configured response, within the vehicle's limits, with the lags of `[response.…]`.

    A velocity is over ground unless the vehicle says that it has no GPS, or the table says otherwise.

    Args:
        parameters: what full sticks shall mean.
        limits: of the vehicle.
        autopilot: MAV_AUTOPILOT.
        table: `[response]`, one table a kind.

    Raises:
        ConfigError: the table is wrong.
    """
    kind = "velocity" if autopilot == PX4 else parameters.kind
    speed_mps, climb_mps = min(parameters.max_speed_mps, limits.speed_mps), min(limits.up_mps, limits.down_mps)
    sticks = parameters.full_sticks(kind, tilt_rad=limits.tilt_rad, climb_mps=climb_mps, speed_mps=speed_mps)
    reference = {"velocity_reference": limits.velocity_reference}
    return build(Response, reference | measured(kind, table) | sticks, f"response.{kind}")
