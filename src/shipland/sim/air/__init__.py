"""The air: wind, turbulence, gusts, airwake."""
