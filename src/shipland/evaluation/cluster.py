"""Flights on a Ray cluster: the same flights, the same rows, kept by this process alone."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from shipland.errors import ConfigError, DataError
from shipland.evaluation.campaign import Executor, Keep, Lose
from shipland.evaluation.folder import campaign_key
from shipland.evaluation.job import FlightJob, land_quietly
from shipland.evaluation.landing import Landing
from shipland.extras import require
from shipland.stopping import check_stop
from shipland.workers import POLL_S

_RETRIES = 3
"""Of a flight whose process or machine died; its result counts once."""
_WAITING_A_CORE = 2
"""Flights given out at a time."""


def cluster(address: str) -> Executor:
    """Flights on the Ray cluster at `address`, or the one that is found (`auto`); every machine wants this very code.

    ConfigError where Ray or such a cluster is missing, DataError where a machine has other code.
    """
    require("cluster", "--cluster", ConfigError)
    import ray

    def executor(flights: Iterable[FlightJob], keep: Keep, lose: Lose) -> Iterator[tuple[FlightJob, Landing]]:
        try:
            ray.init(address=address, log_to_driver=False, ignore_reinit_error=True)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise ConfigError(f"--cluster {address}: no Ray cluster: {error}") from None
        fly = ray.remote(max_retries=_RETRIES, num_cpus=1)(_fly_there)
        waiting, given, here = iter(flights), dict[Any, FlightJob](), dict[str, dict[str, Any]]()
        try:
            while True:
                most = _WAITING_A_CORE * max(1, int(ray.cluster_resources().get("CPU", 1)))
                while len(given) < most and (flight := next(waiting, None)) is not None:
                    given[fly.remote(flight)] = flight
                if not given:
                    return
                check_stop()
                for done in ray.wait(list(given), num_returns=1, timeout=POLL_S)[0]:
                    flight = given.pop(done)
                    try:
                        there, landing, log = ray.get(done)
                    except ray.exceptions.RayError as error:
                        lose(flight, " ".join(str(error).split()[:40]))
                        continue
                    if flight.cell not in here:
                        here[flight.cell] = _bound(flight)
                    if differ := [words for words, digest in here[flight.cell].items() if there[words] != digest]:
                        raise DataError(
                            f"a machine of the cluster has other {', '.join(differ)} than this one; install the same"
                        )
                    if log is not None and flight.log is not None:
                        flight.log.parent.mkdir(parents=True, exist_ok=True)
                        flight.log.write_bytes(log)
                    keep(flight, landing)
                    yield flight, landing
        finally:
            for reference in given:
                ray.cancel(reference, force=True)
            ray.shutdown()

    return executor


def _bound(flight: FlightJob) -> dict[str, Any]:
    """What this machine flies with, by digests; a function travels by value and is the same everywhere."""
    pilot = flight.pilot if isinstance(flight.pilot, str) else "paper"
    vision = flight.vision if isinstance(flight.vision, str) else "geometric"
    key = campaign_key(flight.scenario, pilot, vision)
    return {"code": key["source"], "own pilot or vision code": key["own_code"], "weights": key["weights"]}


def _fly_there(flight: FlightJob) -> tuple[dict[str, Any], Landing, bytes | None]:
    """On a machine of the cluster: what it flew with, the landing, and the log, as its folders are not ours."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.mcap"
        landing = land_quietly(replace(flight, log=None if flight.log is None else path))
        return _bound(flight), landing, path.read_bytes() if path.exists() else None
