"""Vision-based ship landing of VTOL drones: no GPS, no link to the ship [Lee2022]."""

__version__ = "0.1.0"
