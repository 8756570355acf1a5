"""Figures in prose, of the README and of pages, are those of the results or of the page that shows the same flights."""

import json
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = ROOT / "results"
SCENARIOS = ("rig-natops", "rig-sea6", "ship-natops", "ship-sea5", "ship-sea6")


def rows_below(text, link):
    """Cells of the table below a link to results, without head and rule."""
    lines = text.partition(link)[2].split("\n\n")[1].splitlines()
    return [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines[2:]]


def landed():
    """(scenario, stick, pilot) → flights in the square."""
    rows = rows_of("landings")
    return {(r["scenario"], r["stick"], r["pilot"]): round(r["square"] * r["flights"]) for r in rows}


def table_of(name):
    link = f"(results/{name}.json "
    assert link in README
    return rows_below(README, link)


def number(cell):
    return float(re.search(r"\d+(?:\.\d+)?", cell)[0])


def test_sums_of_landings():
    found = landed()
    said = re.search(r"ours lands\s+(\d+)\s+of\s+these\s+500\s+and\s+the\s+published\s+gains\s+land\s+(\d+)\.", README)
    sums = [sum(found[name, "speed", pilot] for name in SCENARIOS) for pilot in ("horizon", "paper")]
    assert [int(said[1]), int(said[2])] == sums


def test_oracle_rates_lie_within_the_measured_interval():
    measured = {row["setting"]: row["oracle_rate"] for row in rows_of("oracle_rates", group="scenarios")}
    for name, row in zip(SCENARIOS, table_of("landings"), strict=True):
        rate = measured[name]
        assert 100 * rate["low"] - 0.05 <= number(row[1]) <= 100 * rate["high"] + 0.05, name


def test_detections_are_those_of_all_scenes():
    page = (ROOT / "docs" / "results" / "far-vision.md").read_text(encoding="utf-8")
    for row in table_of("far_vision"):
        link = f'"table kind={row[0]} group=together'
        every = next(found for found in rows_below(page, link) if found[0] == "all")
        assert row[1:] == [every[1], every[4], every[8], every[9]]

    clear = next(found for found in rows_below(page, '"table kind=ship group=together') if found[0] == "clear")
    assert f"(in clear air 0.99 to {clear[8]} m)" in README


def test_landings_in_9_mps():
    """The README's are the headline's."""
    rows = rows_of("headline", wind="9")
    at_9 = {(row["scenario"], row["stick"]): round(row["square"] * row["flights"]) for row in rows}
    said = " ".join(README.split())
    rig, ship = ([at_9[name, stick] for stick in ("tilt", "speed")] for name in ("rig-natops", "ship-sea6"))
    assert f"ours lands {rig[0]} of 400 on the rig over land and {ship[0]} of 400 on the ship" in said
    assert f"with a tilt; {rig[1]} and {ship[1]} with a speed" in said


def test_full_scale_landings():
    page = (ROOT / "docs" / "results" / "full-scale.md").read_text(encoding="utf-8")
    for count in re.findall(r"(\d+) of 100", README):
        assert re.search(rf"\b{count} of 100\b|\| {count} ", page), count


def rows_of(name, **where):
    rows = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))["rows"]
    return [row for row in rows if all(row[key] == value for key, value in where.items())]


def page(name):
    """A page of results, each run of blanks one blank."""
    return " ".join((ROOT / "docs" / "results" / f"{name}.md").read_text(encoding="utf-8").split())


def of_twenty(settings, stick, wind):
    (row,) = rows_of("landing_rule", settings=settings, stick=stick, wind=wind)
    return round(row["square"] * row["flights"])


def test_the_landing_rule_s_figures_in_prose():
    printed, ours = "law and landing rule as printed", "law as printed, our landing rule"
    still, windy = (of_twenty(printed, "speed", wind) for wind in ("0", "5"))
    tilt = {of_twenty(printed, "tilt", wind) for wind in ("0", "5")}
    assert tilt == {0}
    claim = page("paper-line-by-line")
    assert f"{still} of 20 (23–68 %) in still air and {windy} of 20 (12–54 %) in 5 m/s" in claim
    assert [of_twenty(ours, "speed", wind) for wind in ("0", "5")] == [19, 20]
    assert "with our rule 19 and 20 of 20 do" in page("paper")
    errata = (ROOT / "docs" / "reference" / "errata.md").read_text(encoding="utf-8")
    bounded = of_twenty("bounded law, our landing rule", "tilt", "0")
    assert f"{bounded} of 20 in" in errata and f"in the square in {still}; with our rule in 19" in errata


def test_the_claims_of_accuracy():
    """The ranges up to which a chain is below a centimetre and a degree, square on, by root mean square."""
    found = []
    for chain in ("printed", "ours"):
        rows = rows_of("printed_vision", chain=chain, angle_deg=0.0)
        good = (
            [row["range_m"] for row in rows if row[key] < most] for key, most in (("position_m", 0.01), ("yaw_deg", 1))
        )
        found += [max(ranges) for ranges in good]
    assert found[:3] == [3.0, 7.0, 5.0]
    assert found[3] >= 10.0
    claim = page("paper-line-by-line")
    assert "as printed the first to 3 m and the second to 7 m" in claim
    assert "the first to 5 m, the second to 10 m" in claim


def test_the_claim_of_a_noisy_yaw():
    """Root mean squares at 2, 5, 10 and 20 m square on, as printed and ours."""
    texts = []
    for chain in ("printed", "ours"):
        rows = {row["range_m"]: row["yaw_deg"] for row in rows_of("printed_vision", chain=chain, angle_deg=0.0)}
        texts.append([rows[range_m] for range_m in (2.0, 5.0, 10.0, 20.0)])
    claim = page("paper-line-by-line")
    near, far = texts[0][:1], texts[0][1:]
    assert f"{near[0]:.2f}° at 2 m, {far[0]:.1f}° at 5, {far[1]:.1f}° at 10, {far[2]:.0f}° at 20" in claim
    assert "{:.2f}°, {:.2f}°, {:.1f}° and {:.1f}°".format(*texts[1]) in claim


def test_the_claims_of_far_flights_and_of_a_deck_that_is_followed():
    claim = page("paper-line-by-line")
    counts = {}
    for row in rows_of("far", scenario="far"):
        share = row["success"]
        interval = f"({100 * share['low']:.0f}–{100 * share['high']:.0f} %)"
        counts[row["pilot"]] = f"{round(row['square'] * row['flights'])} of {row['flights']} {interval}"
    assert f"*Ours*: {counts['horizon']}, rendered" in claim
    assert f"*Printed*: {counts['paper']} with a tilt" in claim
    printed = rows_of("far_variants", law="printed")
    tilt, speed = (round(row["square"] * row["flights"]) for row in printed)
    low, high = (100 * printed[0]["success"][key] for key in ("low", "high"))
    assert f"word for word: {tilt} of 10 ({low:.0f}–{high:.0f} %), and {speed} of 10" in claim
    rows = rows_of("follow_published")
    assert [(round(20 * row["square"]), row["won"], row["lost"]) for row in rows] == [(4, 0, 2), (0, 0, 6)]
    assert "6 of 20 (12–54 %) land, followed within 0.5 m 4, from 2 m on none (6 lost, none won, p = 0.03)" in claim
    ours = {row["scenario"]: row for row in rows_of("follow_deck", below="2")}
    rig, ship = (
        [round(row["flights"] * share) for share in (row["square"], row["square_beside"])]
        for row in (ours["rig-natops"], ours["ship-sea6"])
    )
    said = (
        "*Ours*, followed from 2 m on: {} of 150 at NATOPS limits, not followed {}; on a ship in sea state 6 {} and {}."
    )
    assert said.format(*rig, *ship) in claim


def test_the_claim_of_a_ship_under_way():
    def sums(settings, pilot, key="square"):
        found = [rows_of("courses", settings=settings, pilot=pilot, course=it) for it in ("straight", "s", "turn90")]
        return [sum(round(row[key] * row["flights"]) for row in rows) for rows in found]

    claim, printed = page("paper-line-by-line"), "from 10 m, as printed"
    assert "from 10 m {}, {} and {} of 27".format(*sums(printed, "paper")) in claim
    assert "on the deck {}, {} and {};".format(*sums(printed, "paper", "landed")) in claim
    assert "*Ours*: {}, {} and {} of 27 flights".format(*sums("from 40 m", "horizon")) in claim
    assert sum(sums("from 40 m", "paper")) == 1
    assert "from 40 m, bounded, one of 81" in claim


def test_the_claim_of_robustness():
    rows = {row["law"]: row for row in rows_of("paper_figures", figure="near", noise_m=0.0, slew="yes")}
    peaks = [round(rows[law]["peak_percent"]) for law in ("linear D", "linear D, Kalman", "probabilistic D, Kalman")]
    assert f"from {peaks[0]} to {peaks[1]} by the filter, to {peaks[2]} % by the bell" in page("paper-line-by-line")


def test_the_heading_s_swing_is_the_errata_s():
    swing_deg = {row["law"]: row["swing_deg"] for row in rows_of("paper_figures", figure="yaw")}
    errata = (ROOT / "docs" / "reference" / "errata.md").read_text(encoding="utf-8")
    assert f"swings by {swing_deg['Table 2, 0.5 s']:.0f}°, by 4° without the derivative" in " ".join(errata.split())
    assert round(swing_deg["Table 2 without the derivative, 0.5 s"]) == 4
