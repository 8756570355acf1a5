"""Studies: a question, the cases that answer it and how one case is measured; results/NAME.json holds the answers."""

ORDER = (
    *("lqg_bound", "oracle_rates", "tone_errors", "reach", "near_readings", "mirrored", "clock"),
    *("courses", "published_gains", "moment", "margins", "winds", "measurements", "faults", "full", "hazards"),
    *("frigate", "wake", "headline", "far", "frigate_rendered", "landings", "policies"),
)
"""The order in which `make results` runs them: the short ones first."""
