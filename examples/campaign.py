"""A campaign from Python: one pilot, several winds, one line each.

python examples/campaign.py [seeds]
"""

import sys

import shipland


def main(seeds: int = 20, time_limit_s: float = 120.0) -> dict[float, shipland.Campaign]:
    """Fly; the results by wind."""
    done = {}
    for wind_mps in (0.0, 4.0):
        scenario = shipland.load_scenario("near", wind={"mean_mps": wind_mps}, time_limit_s=time_limit_s)
        done[wind_mps] = shipland.campaign(scenario, pilot="horizon", runs=seeds, workers=1)
        longest_s = max(done[wind_mps].table()["time_s"])
        print(f"{wind_mps:.0f} m/s: {done[wind_mps].summary} The longest flight took {longest_s:.0f} s.")
    return done


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
