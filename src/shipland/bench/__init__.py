"""Scenarios, campaigns, metrics and reports."""
