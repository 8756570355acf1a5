"""Shared by every test: one thread a process, hypothesis' profile, the packaged rig and camera, a seeded generator."""

import fcntl
import gc
import logging
import os
import signal
import subprocess
import sys
import zlib
from pathlib import Path

for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "LP_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")  # before NumPy and Mesa read them; xdist's workers share the cores

import hypothesis
import numpy as np
import pytest

import shipland
from shipland.camera import Camera, CameraParameters
from shipland.compiled import cache_folder
from shipland.messages import Frame, GimbalAttitude
from shipland.rig import Rig

# No deadline: the cores are shared. In CI the examples are fixed, so that a red run can be repeated.
hypothesis.settings.register_profile(
    "shipland",
    deadline=None,
    max_examples=50,
    derandomize=bool(os.environ.get("CI")),
    print_blob=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("shipland")

# A shell lets what it starts in the background ignore Ctrl-C, `nohup` a hang-up, and children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)
for _number in (signal.SIGHUP, signal.SIGQUIT, signal.SIGTERM):
    signal.signal(_number, signal.SIG_DFL)

REAL_TIME, SPREAD = (Path(__file__).parent / name for name in ("conformance", "scenarios"))


def _may_choose_its_turn() -> bool:
    """Whether this process may go behind others and come back."""
    own = os.getpriority(os.PRIO_PROCESS, 0)
    try:
        os.setpriority(os.PRIO_PROCESS, 0, own + 1)
        os.setpriority(os.PRIO_PROCESS, 0, own)
    except PermissionError:
        return False
    return True


_OWN_TURN = os.getpriority(os.PRIO_PROCESS, 0) if _may_choose_its_turn() else None


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """Where the system lets it, a test in real time goes before those that only compute: they share the cores."""
    if _OWN_TURN is not None:
        later = 0 if REAL_TIME in item.path.parents else 10
        os.setpriority(os.PRIO_PROCESS, 0, _OWN_TURN + later)


def pytest_collection_modifyitems(items):
    """Tests in real time, which mostly wait, begin; whole flights are next."""
    items.sort(key=lambda item: (item.path.parent != REAL_TIME, item.path.parent != SPREAD))


def _group(nodeid):
    """Tests of one group stay with one worker.

    Those in real time, which mostly wait, are four workers' from the beginning. A file of others stays with one worker,
    so that what it makes once, for instance a flight, a drawn scene or an import, is not made once a worker. Whole
    flights are spread, but for the file whose tests share one.
    """
    path = Path(nodeid.partition("::")[0])
    if path.parent.name == REAL_TIME.name:
        return f"real time, {zlib.crc32(nodeid.encode()) % 4}"
    spread = path.parent.name == SPREAD.name and path.stem != "test_whole_flight"
    return nodeid if spread else path.stem


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """With `--dist loadgroup` the groups are `_group`'s: with pytest 9.2 xdist's own find no mark (its issue 1386)."""
    if config.getoption("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class Groups(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            return _group(nodeid)

    return Groups(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """What collecting makes lives to the end: no collection of garbage looks at it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def _fly():
    from shipland.scenario.fly import fly_quietly
    from shipland.scenario.scenario import load_scenario

    fly_quietly(load_scenario("rig-natops", time_limit_s=1.0), "horizon", "geometric", 3)


def _see():
    from pictures import Look, bar_picture, camera_from_bar
    from shipland.vision.near.pipeline import NearVision
    from shipland.vision.parameters import VisionParameters

    cue, camera, rng = Rig().cue, Camera.from_fov(640, 360, 69.0), np.random.default_rng(1)
    vision = NearVision(cue, camera, VisionParameters())
    for t_s in (0.0, 0.1):
        image = bar_picture(cue, camera, camera_from_bar((-3.0, 0.3, 0.1), -0.1), rng, Look(0.4, 1.0))
        vision.see(Frame(t_s, image, GimbalAttitude(0.0, 0.0)))


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory):
    """Of the workers beside each other, one compiles what a flight calls and one what near vision calls.

    The others wait for their machine code.
    """
    if cache_folder(Path(shipland.__file__).parent) is None or "PYTEST_XDIST_WORKER" not in os.environ:
        return
    beside = tmp_path_factory.getbasetemp().parent
    for wait in (fcntl.LOCK_NB, 0):
        for compiles in (_fly, _see):
            done = beside / f"compiled{compiles.__name__}"
            with (beside / f"compiling{compiles.__name__}").open("w") as lock:
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | wait)
                except BlockingIOError:
                    continue
                if not done.exists():
                    compiles()
                    done.touch()


@pytest.fixture(scope="session")
def rig() -> Rig:
    """The packaged rig."""
    return Rig()


@pytest.fixture(scope="session")
def camera() -> Camera:
    """The packaged camera: 1280 × 720 px, 69°, no distortion."""
    return Camera.from_parameters(CameraParameters())


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(1797)


@pytest.fixture
def here(monkeypatch, capsys):
    """The command line in this process, which has imported everything already."""

    from shipland.cli import main

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["shipland", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        said = capsys.readouterr()
        return subprocess.CompletedProcess(arguments, end.value.code or 0, said.out, said.err)

    return call


@pytest.fixture
def without_plots(monkeypatch):
    """A flight's folder gets no figures, which take longer than a short flight: others look at them."""
    monkeypatch.setattr("shipland.report.outputs.installed", lambda _: False)


@pytest.fixture
def unarranged(monkeypatch):
    """Figures are drawn without arranging their parts, which takes as long as drawing: others arrange the same."""
    monkeypatch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda *_: None)


@pytest.fixture(autouse=True)
def no_vision_fails_unnoticed(request, caplog):
    """In flight a vision that raises only costs its frame; a test it fails, unless marked `vision_fails`."""
    yield
    if request.node.get_closest_marker("vision_fails") is None:
        records = [r for when in ("setup", "call") for r in caplog.get_records(when)]
        failed = [r for r in records if r.name == "shipland.vision.vision" and r.levelno >= logging.ERROR]
        assert not failed, failed[0].getMessage() + "\n" + str(failed[0].exc_text or failed[0].exc_info)
