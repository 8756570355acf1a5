"""Many landings: flown, kept, judged, compared."""
