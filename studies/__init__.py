"""Studies: a question, the cases that answer it and how one case is measured; results/NAME.json holds the answers."""

ORDER = tuple(
    """
    lqg_bound turbulence wind_readings scale ship_motions deck_share step_responses tone_errors deck_sights
    near_readings mirrored oracle_rates printed_vision landing_rule far_wind far_variants follow_deck
    follow_published varying_speed speed_physics speed_environments speed_link speed_render speed_landings
    speed_near speed_photographs speed_far speed_peers paper_figures pilot_consistency reliability reach
    spoiled_cue consistency clock baselines pose_error film_errors far_vision published_network frigate_recall
    false_accepts confirmation courses published_gains margins wave_off ablation winds measurements faults full
    hazards frigate wake headline far far_rendered frigate_rendered visibility night landings policies
    own_landing envelope
    """.split()  # noqa: SIM905 - a list of names, a line for each kind
)
"""The order in which `make results` runs them: the short ones first."""
