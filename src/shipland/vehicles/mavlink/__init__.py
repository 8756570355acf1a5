"""ArduPilot and PX4 over MAVLink."""
