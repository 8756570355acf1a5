"""A learned policy from an ONNX file, behind `Steering`: it never raises, and the pilot flies alone when it fails."""

from __future__ import annotations

import logging
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from shipland.errors import ConfigError
from shipland.files import check_digest, json_of
from shipland.frames import Array
from shipland.guidance.horizon.steering import ENTRIES, Action, Kind, Steered, Steering, observation_of
from shipland.guidance.response import Response

FORMAT = "shipland-policy-1"
_log = logging.getLogger(__name__)


class LearnedSteering(Steering):
    """A policy of one kind.

    Args:
        name: packaged, or the path of an ONNX file.
        kind: that it must be of.
        response: of the vehicle.

    Raises:
        ConfigError: no such policy, a broken file, or one of another kind or for another observation.
        DataError: a damaged file (`check_digest`).
    """

    def __init__(self, name: str, kind: Kind, response: Response) -> None:
        path = policy_path(name)
        self._session, self._action = _load(path)
        if self._action.kind != kind:
            raise ConfigError(f"policy {path} is of the kind {self._action.kind!r}, not {kind!r}")
        self.note = ""
        """What is wrong with the policy, in words; empty where nothing is."""
        self._fits = response.kind == "attitude"
        if not self._fits:
            self._fail("it steers tilts, and sticks of this vehicle mean a velocity")

    def input_mps2(self, seen: Steered) -> Array:
        """See `Steering`."""
        own = seen.wanted_mps2
        if not self._fits or not self._action.applies(seen):
            return own
        try:
            observation = observation_of(seen).astype(np.float32)[None]
            found = self._session.run(None, {"observation": observation})[0]
            action = np.asarray(found, dtype=float).reshape(2)
        except Exception as error:  # a policy's fault must not end a flight
            self._fail(f"{type(error).__name__}: {error}")
            return own
        if not np.isfinite(action).all():
            self._fail("its action is not finite")
            return own
        self.note = ""
        return self._action.input_mps2(seen, action)

    def _fail(self, why: str) -> None:
        note = f"policy left out: {' '.join(why.split())}"
        if note != self.note:
            _log.warning(note)
        self.note = note


def policy_path(name: str) -> Path:
    """The file of a packaged policy, or `name` as a path.

    Raises:
        ConfigError: neither.
    """
    folder = Path(str(resources.files("shipland"))) / "weights" / "policies"
    packaged = folder / f"{name}.onnx"
    if packaged.is_file():
        return packaged
    path = Path(name)
    if path.is_file():
        return path
    known = ", ".join(sorted(item.stem for item in folder.glob("*.onnx"))) or "none"
    raise ConfigError(f"no policy {name!r}: give a file that `shipland learn` made, or one of the packaged: {known}")


def _load(path: Path) -> tuple[Any, Action]:
    """The policy's session on one thread, and what its action means."""
    import onnxruntime

    from shipland.former import todays

    check_digest(path)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        about = session.get_modelmeta().custom_metadata_map
        shape = session.get_inputs()[0].shape
    except Exception as error:
        raise ConfigError(f"policy {path} is no ONNX file that can be run: {error}") from None
    if about.get("format") != FORMAT:
        raise ConfigError(f"policy {path} was not written by this version's `shipland learn`")
    try:
        entries = [todays(entry) for entry in json_of(about["entries"])]
        action = Action(**json_of(about["action"]))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ConfigError(f"policy {path}: its metadata is broken: {error}") from None
    if entries != list(ENTRIES) or shape[-1] != len(ENTRIES):
        raise ConfigError(f"policy {path} wants to see other things than this version's pilot shows; train it anew")
    return session, action
