"""The aircraft: airframe, inner loop, sensors."""
