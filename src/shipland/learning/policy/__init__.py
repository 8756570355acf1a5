"""Policies for the last metres, trained in the simulator."""
