"""Rivals: pilots of other schools, one file each, inside the published modes (docs/explanation/rivals.md)."""
