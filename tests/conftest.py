"""Shared by every test: one thread a process, hypothesis' profile, the packaged rig and camera, a seeded generator."""

import logging
import os

for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "LP_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")  # before NumPy and Mesa read them; xdist's workers share the cores

import hypothesis
import numpy as np
import pytest

from shipland.camera import Camera, CameraParameters
from shipland.config import build
from shipland.rig import Rig, default_rig, packaged_table

# No deadline: the cores are shared. In CI the examples are fixed, so that a red run can be repeated.
hypothesis.settings.register_profile(
    "shipland",
    deadline=None,
    derandomize=bool(os.environ.get("CI")),
    print_blob=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("shipland")


@pytest.fixture(scope="session")
def rig() -> Rig:
    """The packaged rig."""
    return default_rig()


@pytest.fixture(scope="session")
def camera() -> Camera:
    """The packaged camera: 1280 × 720 px, 69°, no distortion."""
    return Camera.from_parameters(build(CameraParameters, packaged_table("camera"), "camera"))


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(1797)


@pytest.fixture(autouse=True)
def no_vision_fails_unnoticed(request, caplog):
    """In flight a vision that raises only costs its frame; a test it fails, unless marked `vision_fails`."""
    yield
    if request.node.get_closest_marker("vision_fails") is None:
        records = [r for when in ("setup", "call") for r in caplog.get_records(when)]
        failed = [r for r in records if r.name == "shipland.vision.vision" and r.levelno >= logging.ERROR]
        assert not failed, failed[0].getMessage() + "\n" + str(failed[0].exc_text or failed[0].exc_info)
