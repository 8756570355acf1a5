"""The simulated world: physics, ship, sea, wind, picture."""
