"""Studies: a question, the cases that answer it and how one case is measured; results/NAME.json holds the answers."""

ORDER = (
    *(
        "lqg_bound",
        "oracle_rates",
        "tone_errors",
        "scale",
        "step_responses",
        "deck_share",
        "deck_sights",
        "reach",
        "spoiled_cue",
        "pilot_consistency",
        "consistency",
        "near_readings",
        "mirrored",
    ),
    *("clock", "pose_error", "film_errors", "false_accepts", "frigate_recall"),
    *("courses", "published_gains", "moment", "margins", "winds", "measurements", "faults", "full", "hazards"),
    *("frigate", "wake", "headline", "far", "frigate_rendered", "landings", "policies"),
)
"""The order in which `make results` runs them: the short ones first."""
