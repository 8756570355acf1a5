"""Observations to commands: laws, modes, pilots, safety."""
