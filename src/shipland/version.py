"""Which code this is. The build takes the wheel's version from here too (`[tool.hatch.version]` of pyproject.toml)."""

from __future__ import annotations

import functools
import re
import subprocess  # git alone, with fixed arguments
from importlib import metadata
from pathlib import Path

RELEASE = "0.1.0"
"""The newest release of CHANGELOG.md: the base where neither an installation nor a tag names one."""

_DESCRIBED = re.compile(r"(?:v(?P<release>.+)-(?P<after>\d+)-g)?(?P<commit>[0-9a-f]+)(?P<dirty>-dirty)?")


@functools.cache
def code_version() -> str:
    """`1.2.0` at the tag `v1.2.0`, `1.2.0.post7+g4748a7e` seven commits after it, `.dirty` where files differ.

    An installed package says what it was built from; a checkout asks git; any other tree is `RELEASE`.
    """
    beside = Path(__file__).resolve().parents[1]
    for installed in metadata.distributions(name="shipland", path=[str(beside)]):
        return installed.version
    return _described(beside.parent) if (beside.parent / ".git").exists() else RELEASE


def _described(root: Path) -> str:
    """Version of the checkout at `root`; `RELEASE` where git is missing or refuses."""
    command = ["git", "-C", str(root), "describe", "--tags", "--match=v[0-9]*", "--long", "--always", "--dirty"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True)  # noqa: S603
    except (OSError, subprocess.SubprocessError):
        return RELEASE
    return version_of(done.stdout.strip())


def version_of(described: str) -> str:
    """What `git describe --long --always --dirty` says, as a version (PEP 440).

    >>> version_of("v1.2.0-0-g4748a7e"), version_of("v1.2.0-7-g4748a7e-dirty")
    ('1.2.0', '1.2.0.post7+g4748a7e.dirty')
    """
    parts = _DESCRIBED.fullmatch(described)
    if parts is None:
        return RELEASE
    release, after, commit, dirty = parts.group("release", "after", "commit", "dirty")
    if after == "0" and not dirty:
        return str(release)
    post = f".post{after}" if after not in (None, "0") else ""
    return f"{release or RELEASE}{post}+g{commit}{'.dirty' if dirty else ''}"
