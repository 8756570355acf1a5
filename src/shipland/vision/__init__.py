"""Pictures to observations."""
