"""The MAVLink dialect that is spoken: ArduPilot's, which holds the common messages that PX4 speaks."""

from __future__ import annotations

from typing import Any

from shipland.errors import VehicleError

try:
    from pymavlink.dialects.v20 import ardupilotmega
except ModuleNotFoundError as error:  # the extra is optional
    raise VehicleError(f"mavlink:// needs {error.name}; install it with: pip install 'shipland[mavlink]'") from None

dialect: Any = ardupilotmega
"""Generated classes and constants, without types."""
Message = Any
"""A decoded message of the dialect."""
