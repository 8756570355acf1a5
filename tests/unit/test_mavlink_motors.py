"""When a MAVLink vehicle is asked to stop its motors."""

import pytest

pytest.importorskip("pymavlink")

from fuzz_link import Nowhere

from shipland.messages import Intent, PilotCommand
from shipland.vehicles.mavlink.motors import MotorStop
from shipland.vehicles.mavlink.parameters import MavlinkParameters
from shipland.vehicles.mavlink.session import Session
from shipland.vehicles.mavlink.state import AutopilotState
from shipland.vehicles.touchdown import TouchdownParameters


@pytest.mark.parametrize(("flown_percent", "stops"), [(39.0, True), (0.0, False)])
def test_a_throttle_of_zero_stops_no_motor_where_it_was_zero_in_flight(flown_percent: float, stops: bool) -> None:
    """Zero is also the word of a vehicle that does not tell its throttle: a steady descent would read as standing."""
    port = Nowhere()
    session = Session(port, 245, 191, None, None, None, lambda *_: None)
    motors = MotorStop(session, MavlinkParameters(), TouchdownParameters(), 0.39)
    for turn in range(200):
        t_s, lands = 100.0 + 0.02 * turn, turn >= 100
        state = AutopilotState(
            heartbeat_s=t_s, asked_s=t_s, armed=True, throttle_t_s=t_s, velocity_t_s=t_s,
            throttle_percent=0.0 if lands else flown_percent, velocity_in_ned_mps=(0.0, 0.0, 0.4 if lands else 0.0),
        )  # fmt: skip
        intent = Intent.LAND if lands else Intent.FLY
        motors.look(PilotCommand(t_s, 0.0, 0.0, -40.0, 0.0, 0.0, intent, lands), state, t_s)
    assert bool(port.sent) == stops
