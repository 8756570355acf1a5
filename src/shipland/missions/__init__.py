"""Missions and their verdicts: scenarios, single flights, campaigns, rules."""
