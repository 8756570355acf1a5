"""Citations of the paper name sections, equations and tables that it has; its source is not in the repository."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
SECTIONS = (
    "Introduction",
    "Machine Vision",
    "Machine Learning Based Approach",
    "Classical Computer Vision Based Approach",
    "Image Filtering",
    "Contour and Corner Detection",
    "Detected Points Screening",
    "Relative Position and Orientation (Pose) Estimation",
    "Nonlinear Control System",
    "Long-range Tracking Controller",
    "Close-range Tracking Controller",
    "Flight Testing",
    "Experimental Setup",
    "Ship Motions and Vertical Landing Safety",
    "Tracking Capability and Landing Accuracy",
    "Conclusion",
)
"""Of [Lee2022], in its order."""
SHORT = {"Pose Estimation": "Relative Position and Orientation (Pose) Estimation"}
EQUATIONS, TABLES = 5, 3
"""1 window, 2 Kalman filter, 3 far law, 4 near law, 5 derivative gain; 1 far constants, 2 near gains, 3 ships."""
FOLDERS = ("src", "tests", "studies", "tools", "examples", "docs")
TITLE = re.compile(r'§([^\],"]+)')
NUMBERED = re.compile(r"(Eq\.|Table) (\d+)(?:[–-](\d+))?")


def citations():
    """(file, what stands in the brackets after the name) of every citation."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in {".py", ".md", ".toml"} and path != Path(__file__):
                text = re.sub(r"\s*\n\s*#?\s*", " ", path.read_text(encoding="utf-8"))
                yield from ((path.relative_to(ROOT), said) for said in re.findall(r"\[Lee2022, ([^\]]*)\]", text))


def wrong(said):
    """What a citation names that the paper does not have."""
    titles = [title.strip() for title in TITLE.findall(said)]
    found = [title for title in titles if title not in SECTIONS and title not in SHORT]
    for kind, first, last in NUMBERED.findall(said):
        most = EQUATIONS if kind == "Eq." else TABLES
        found += [f"{kind} {number}" for number in (first, last or first) if not 1 <= int(number) <= most]
    if not titles and not NUMBERED.search(said):
        found.append(said)
    return found


def test_citations_name_what_the_paper_has():
    every = list(citations())
    assert len(every) > 40
    assert {f"{path}: {name}" for path, said in every for name in wrong(said)} == set()


def test_a_wrong_citation_is_found():
    assert wrong("§Image Filtering") == wrong("Eq. 4–5, Table 2") == wrong('§Experimental Setup, "a figure"') == []
    assert wrong("§Results") == ["Results"]
    assert wrong("Eq. 5–6") == ["Eq. 6"]
    assert wrong("flowchart") == ["flowchart"]


def test_the_laws_cite_the_equations_that_they_are():
    laws = (ROOT / "src" / "shipland" / "guidance" / "laws.py").read_text(encoding="utf-8")
    for function, number in (("exponential_law", 3), ("near_law", 4), ("derivative_gain", 5)):
        docstring = laws.partition(f"def {function}(")[2].split('"""')[1]
        assert re.findall(r"Eq\. (\d)", docstring) == [str(number)], function
