"""Studies: a question, the cases that answer it and how one case is measured; results/NAME.json holds the answers."""

ORDER = ("lqg_bound", "oracle_rates", "tone_errors", "reach", "courses", "margins")
"""The order in which `make results` runs them: the short ones first."""
