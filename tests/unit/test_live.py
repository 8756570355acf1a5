"""A flight over Foxglove's WebSocket, read by a bare client; and the layout beside a log."""

from __future__ import annotations

import base64
import json
import os
import socket
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from made_up_flight import CAMERA, INFO, RIG, VERDICT, flight, write_log

from shipland.errors import ConfigError
from shipland.record.layout import write_layout
from shipland.record.live import LiveView

TOPICS = {"/header", "/flight", "/verdict", "/tf", "/scene", "/log", "/camera/image", "/pose/aircraft"}


class Viewer:
    """Speaks `foxglove.sdk.v1`: sees what is advertised, subscribes to it, and takes messages."""

    def __init__(self, address: str) -> None:
        host, port = address.removeprefix("ws://").split(":")
        self._socket = socket.create_connection((host, int(port)), 10.0)
        key = base64.b64encode(os.urandom(16)).decode()
        self._socket.sendall(
            f"GET / HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
        )
        self._stream = self._socket.makefile("rb")
        assert b"101" in self._stream.readline()
        while self._stream.readline() != b"\r\n":
            pass
        self.topics: dict[int, str] = {}

    def frames(self) -> Iterator[tuple[int, bytes]]:
        while True:
            first, second = self._stream.read(2)
            length = second & 127
            if length > 125:
                size = 2 if length == 126 else 8
                length = int.from_bytes(self._stream.read(size), "big")
            yield first & 15, self._stream.read(length)

    def subscribe(self) -> None:
        """To everything, once all of `TOPICS` is advertised."""
        for kind, data in self.frames():
            told = json.loads(data) if kind == 1 else {}
            for channel in told.get("channels", ()):
                self.topics[channel["id"]] = channel["topic"]
            if set(self.topics.values()) >= TOPICS:
                break
        asked = {"op": "subscribe", "subscriptions": [{"id": it, "channelId": it} for it in self.topics]}
        asked["channelIds"] = list(self.topics)
        data = json.dumps(asked).encode()
        mask = os.urandom(4)
        masked = bytes(byte ^ mask[index % 4] for index, byte in enumerate(data))
        self._socket.sendall(struct.pack("!BBH", 0x81, 0x80 | 126, len(data)) + mask + masked)

    def until(self, topics: set[str]) -> dict[str, list[bytes]]:
        """Messages by topic, until each of these has come."""
        got: dict[str, list[bytes]] = {}
        for kind, data in self.frames():
            if kind == 2 and data[0] == 1:
                subscription, _ = struct.unpack("<IQ", data[1:13])
                got.setdefault(self.topics[subscription], []).append(data[13:])
            if topics <= got.keys():
                break
        return got

    def close(self) -> None:
        self._stream.close()
        self._socket.close()


def test_who_looks_sees_the_flight_what_was_told_once_and_the_verdict() -> None:
    records = list(flight(from_s=20.0, to_s=20.4))
    with LiveView(INFO, RIG, CAMERA, port=0) as live:
        assert not live.wait(0.0)
        live.append(records[0])  # before anybody looks
        viewer = Viewer(live.address)
        viewer.subscribe()
        assert live.wait(10.0)
        for record in records[1:]:
            live.append(record)
        live.finish(VERDICT, "landed")
        got = viewer.until({"/header", "/flight", "/scene", "/tf", "/log", "/camera/image", "/verdict"})
        viewer.close()
    assert json.loads(got["/verdict"][0])["landed"] is True
    assert json.loads(got["/flight"][-1])["frame_t_s"] == records[-1].frame.t_s


def test_a_port_that_is_taken_names_the_option() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=rf"127\.0\.0\.1:{port}.*--live-port"):
            LiveView(INFO, RIG, CAMERA, port=port)


def test_a_viewer_that_does_not_read_keeps_nobody() -> None:
    (record,) = list(flight(from_s=20.0, to_s=20.03))[:1]
    with LiveView(INFO, RIG, CAMERA, port=0) as live:
        viewer = Viewer(live.address)
        viewer.subscribe()
        assert live.wait(10.0)
        for count in range(300):
            live.append(replace(record, frame=replace(record.frame, t_s=20.0 + count)))
        assert live.left_out > 0  # 300 pictures take longer than giving them
        viewer.close()


def test_every_channel_of_the_layout_is_in_the_log_with_its_field(tmp_path: Path) -> None:
    log = write_log(tmp_path / "flight.mcap", flight(from_s=20.0, to_s=20.2))
    write_layout(tmp_path / "layout.json")
    text = (tmp_path / "layout.json").read_text()
    topics, fields = _topics_and_fields(log)
    layout = json.loads(text)
    assert set(_panels(layout["layout"])) == layout["configById"].keys()
    named = set(_values(layout["configById"]))
    asked = {value for value in named if value.startswith("/")}
    assert {value.partition(".")[0] for value in asked} <= topics
    rows = {value.partition(".")[2].partition("[")[0] for value in asked if value.startswith("/flight.")}
    assert len(rows) == 7
    assert rows <= fields
    third = [path["label"] for path in layout["configById"]["Plot!place"]["paths"] if path["value"].endswith("[2]")]
    assert third == ["up (estimate)", "up (truth)"]  # as FlightColumns has it


def _panels(node: object) -> Iterator[str]:
    if isinstance(node, dict):
        yield from _panels(node["first"])
        yield from _panels(node["second"])
    else:
        yield str(node)


def _values(node: object) -> Iterator[str]:
    if isinstance(node, dict):
        for key, value in node.items():
            if key.startswith("/"):
                yield key
            yield from _values(value)
    elif isinstance(node, list):
        for value in node:
            yield from _values(value)
    elif isinstance(node, str):
        yield node


def _topics_and_fields(log: Path) -> tuple[set[str], set[str]]:
    from mcap.reader import make_reader

    topics, fields = set(), set()
    with log.open("rb") as stream:
        for _, channel, told in make_reader(stream).iter_messages():
            topics.add(channel.topic)
            if channel.topic == "/flight":
                fields |= json.loads(told.data).keys()
    return topics, fields
