"""A ROS 2 node on DDS by Cyclone: topics as every rmw over DDS names them, with the bytes that `types` makes.

The wire is RTPS, so that Fast DDS and Cyclone on the other side take it as it is.

Services are not spoken: over DDS each rmw finds the request of a reply by its own means (Fast DDS by the sample's
inline QoS, which Cyclone's Python binding cannot write; Cyclone by a header of its own), so that none fits all;
`examples/ros2_land.py` speaks one in rclpy.
"""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from shipland.errors import ConfigError, VehicleError
from shipland.extras import require
from shipland.soundness import is_new, words_of
from shipland.vehicles.ros2.types import PRIMITIVES, cdr_of, message_of, store, type_hash

if TYPE_CHECKING:
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader

_log = logging.getLogger(__name__)

_BLOCKED_NS = 5_000_000
"""How long a message may wait for a slow listener before it is left out: a set-point's thread goes on."""
_WOKEN_NS = 200_000_000
"""How often the receiving thread looks whether it is to end."""
_TAKEN = 8
"""Messages that are taken from a topic at once."""
_RECEIVE_BUFFER_B = 4_194_304
"""Asked of the system for pictures: of 2.8-MB pictures at 30 Hz its usual 212,992 bytes lose half."""
_LARGE = "<MaxMessageSize>65500B</MaxMessageSize><FragmentSize>60000B</FragmentSize>"
"""Pieces of a picture on loopback: as large as UDP takes. Of pieces of 1.3 kB, Cyclone's own for networks, Fast DDS's
receive buffer loses some, which are sent again 0.1 s later."""
_FAST_DDS = "1.15"
"""Vendor whose XTypes descriptions are not compared: its version 3 sends flags that Cyclone refuses as invalid (its
pull requests 2333 and 2342), and no topic with a sequence or an array would be matched. Names are compared still."""
_ENDPOINTS = 10_000
"""Publishers in a domain that are looked through."""
_PARTICIPANTS = 32
"""ROS 2 processes on this machine that are looked for where there is no multicast."""


def domain_id(given: float | None) -> int:
    """The domain: given, else ROS_DOMAIN_ID, else 0; ConfigError when it is none."""
    text = os.environ.get("ROS_DOMAIN_ID") or "0" if given is None else f"{given:g}"
    if not text.isdecimal() or not 0 <= int(text) <= 232:
        raise ConfigError(f"ROS domain {text}: expected 0 to 232 (?domain= of the address, or ROS_DOMAIN_ID)")
    return int(text)


def only_this_machine() -> bool:
    """Whether ROS's own variables keep discovery on this machine."""
    return (
        os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "") == "LOCALHOST"
        or os.environ.get("ROS_LOCALHOST_ONLY", "0") == "1"
    )


def settings(local: bool) -> str:
    """Cyclone's configuration, `local` for loopback alone; what stands in CYCLONEDDS_URI goes over it."""
    loopback = (
        '<General><Interfaces><NetworkInterface name="lo"/></Interfaces>'
        f"<AllowMulticast>false</AllowMulticast>{_LARGE}</General>"
        '<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers>'
        f"<MaxAutoParticipantIndex>{_PARTICIPANTS}</MaxAutoParticipantIndex></Discovery>"
    )
    buffer = f'<Internal><SocketReceiveBufferSize max="{_RECEIVE_BUFFER_B}B"/></Internal>'
    names = f"<Compatibility><IgnoreTypeInformation>{_FAST_DDS}</IgnoreTypeInformation></Compatibility>"
    own = f"<CycloneDDS><Domain>{loopback if local else ''}{buffer}{names}</Domain></CycloneDDS>"
    return ",".join(filter(None, (own, os.environ.get("CYCLONEDDS_URI", ""))))


class Publisher:
    """Writes one topic; made by `Node.publisher`."""

    def __init__(self, writer: DataWriter[Any], kind: Any) -> None:  # noqa: ANN401
        self._writer: DataWriter[Any] | None = writer
        self._kind = kind
        self.left_out = 0
        """Messages that a slow listener, or the node's end, kept from being sent."""

    @property
    def heard(self) -> bool:
        """Whether anybody listens."""
        writer = self._writer
        return writer is not None and bool(writer.get_matched_subscriptions())

    def send(self, sent: Any) -> None:  # noqa: ANN401 - a message of any type
        """Send a message; never waits for long, and never raises in flight."""
        from cyclonedds.core import DDSException

        writer = self._writer
        if writer is None:
            self.left_out += 1
            return
        sample = self._kind.__new__(self._kind)
        sample.cdr = cdr_of(sent)
        try:
            writer.write(sample)
        except DDSException:
            self.left_out += 1

    def close(self) -> None:
        """Take the topic back, with what it kept for those who come later; what listeners have not got yet goes out."""
        self._writer = None  # Cyclone's entities end with their objects


def require_dds() -> None:
    """Nothing where the extra is installed; else VehicleError with what to install."""
    store()
    require("ros2", "ros2:// (Python 3.11 to 3.13)", VehicleError, "cyclonedds")


class Node:
    """A participant, its topics, and one thread on which everything received is handed over."""

    def __init__(self, domain: int, local: bool) -> None:
        require_dds()
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.core import DDSException, Policy, Qos, WaitSet
        from cyclonedds.domain import DomainParticipant

        try:
            _domain(domain, settings(local))
            self._participant: DomainParticipant = DomainParticipant(domain, qos=Qos(Policy.Userdata(b"enclave=/;")))
        except DDSException as error:
            raise VehicleError(f"DDS cannot be opened in domain {domain}: {error}") from None
        self._endpoints = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._waiting: Any = WaitSet(self._participant)
        self._readers: list[tuple[DataReader[Any], str, Callable[[Any], None]]] = []
        self._publishers: list[Publisher] = []
        self._closed = threading.Event()
        self.malformed = 0
        """Messages that could not be read or taken."""
        self._known = set[type[BaseException]]()
        self._thread = threading.Thread(target=self._receive, name="ros2", daemon=True)
        self._thread.start()

    def publisher(self, topic: str, kind: str, *, latched: bool = False) -> Publisher:
        """A publisher of `/topic`; `latched` keeps the newest for those who come later (transient local)."""
        from cyclonedds.pub import DataWriter

        made, data = self._topic(topic, kind)
        writer = DataWriter(self._participant, made, _quality(kind, reliable=True, latched=latched))
        self._publishers.append(Publisher(writer, data))
        return self._publishers[-1]

    def subscribe(
        self, topic: str, kind: str, take: Callable[[Any], None], *, reliable: bool = False, latched: bool = False
    ) -> None:
        """Have every message of `/topic` handed to `take`, on the node's thread.

        Args:
            topic: without its first slash.
            kind: as `sensor_msgs/msg/Image`.
            take: may raise; the message then counts as malformed.
            reliable: for what is sent once; only reliable publishers are heard then, otherwise all.
            latched: what a publisher keeps from before is handed over too; a live message may then come twice.
        """
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState
        from cyclonedds.sub import DataReader

        made, _ = self._topic(topic, kind)
        qualities = [_quality(kind, reliable=reliable, latched=False)]
        if latched:  # such a reader hears no publisher that keeps nothing
            qualities.append(_quality(kind, reliable=True, latched=True))
        for quality in qualities:
            reader = DataReader(self._participant, made, quality)
            self._readers.append((reader, kind, take))
            self._waiting.attach(ReadCondition(reader, SampleState.Any | ViewState.Any | InstanceState.Any))

    def is_published_by_another(self, topic: str) -> bool:
        """Whether another participant publishes `/topic`, as far as is known by now."""
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState

        alive = ReadCondition(self._endpoints, SampleState.Any | ViewState.Any | InstanceState.Alive)
        found = self._endpoints.read(_ENDPOINTS, condition=alive)
        name, own = _dds_name(topic), self._participant.guid
        return any(each.topic_name == name and each.participant_key != own for each in found)

    def close(self) -> None:
        """End: nothing is handed over or sent after this, nobody finds us listening, nothing is kept for later."""
        self._closed.set()
        if self._thread is not threading.current_thread():
            self._thread.join(2.0)
        for publisher in self._publishers:
            publisher.close()
        self._readers.clear()
        self._waiting = None  # it holds the readers too

    def _topic(self, topic: str, kind: str) -> tuple[Any, Any]:
        from cyclonedds.topic import Topic

        data = _raw(kind)
        return Topic(self._participant, _dds_name(topic), data), data

    def _receive(self) -> None:
        waiting = self._waiting
        while not self._closed.is_set():
            waiting.wait(_WOKEN_NS)
            for reader, kind, take in list(self._readers):
                for data in self._taken(reader):
                    if self._closed.is_set():
                        return
                    try:
                        take(message_of(data, kind))
                    except Exception as error:  # whatever a stranger's message does, the next one is received
                        self.malformed += 1
                        if is_new(error, self._known):
                            _log.warning("a message was not taken: %s: %s", kind, words_of(error))

    def _taken(self, reader: DataReader[Any]) -> list[bytes]:
        """The bytes of what has come; the sample that says that a writer has gone has none."""
        from cyclonedds.core import DDSException

        try:
            return [sample.cdr for sample in reader.take(_TAKEN) if hasattr(sample, "cdr")]
        except DDSException:
            self.malformed += 1
            return []


def _dds_name(topic: str) -> str:
    return f"rt/{topic.strip('/')}"


def _quality(kind: str, *, reliable: bool, latched: bool) -> Any:  # noqa: ANN401
    from cyclonedds.core import Policy, Qos

    return Qos(
        Policy.Reliability.Reliable(_BLOCKED_NS) if reliable else Policy.Reliability.BestEffort,
        Policy.History.KeepLast(1 if latched else _TAKEN),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.Userdata(f"typehash={type_hash(kind)};".encode()),
    )


@lru_cache
def _domain(number: int, text: str) -> object:
    """Configures a domain, once in a process: it lives as long."""
    from cyclonedds.domain import Domain

    return Domain(number, text)


@lru_cache
def _raw(kind: str) -> Any:  # noqa: ANN401
    """The DDS type of a ROS 2 type: its name and description, while samples carry the bytes as they are."""
    data = _idl_of(kind)
    data.serialize = lambda self, *_, **__: self.cdr

    def deserialize(cls: Any, cdr: bytes, *_: object, **__: object) -> Any:  # noqa: ANN401
        sample = cls.__new__(cls)
        sample.cdr = cdr
        return sample

    def nothing(_cls: Any, *_: object, **__: object) -> None:  # noqa: ANN401
        """The sample that says that a writer has gone carries no message."""

    data.deserialize_key = classmethod(nothing)  # type: ignore[arg-type]
    data.deserialize = classmethod(deserialize)  # type: ignore[arg-type]
    return data


@lru_cache
def _idl_of(kind: str) -> Any:  # noqa: ANN401
    from cyclonedds.idl import make_idl_struct

    package, _, short = kind.split("/")
    fields = {name: _field(*what) for name, what in store().fielddefs[kind][1]}
    return make_idl_struct(f"{short}_", f"{package}.msg.dds_.{short}_", fields, dataclassify=False)


def _field(node: Any, what: Any) -> Any:  # noqa: ANN401
    """The IDL type of a field, by rosbags' description of it."""
    from cyclonedds.idl import types
    from rosbags.interfaces import Nodetype

    if node is Nodetype.NAME:
        return _idl_of(what)
    if node is Nodetype.BASE:
        name = PRIMITIVES.get(what[0], what[0])
        return {"string": str, "bool": bool}.get(name) or getattr(types, name)
    inner, count = what
    return types.array[_field(*inner), count] if node is Nodetype.ARRAY else types.sequence[_field(*inner)]
