"""A little RTSP server on 127.0.0.1: one H.264 stream over RTP on UDP, one client (RFC 2326, RFC 3550, RFC 6184)."""

import random
import socket
import struct
import threading
import time
from contextlib import suppress

CLOCK_HZ, LARGEST_PACKET = 90_000, 1_400
NTP_EPOCH_S = 2_208_988_800  # from 1900 to 1970
END_OF_ACCESS_UNIT = 9  # NAL unit type: access unit delimiter


def nal_units(stream):
    """NAL units of an Annex B byte stream, without their start codes."""
    starts, at = [], stream.find(b"\x00\x00\x01")
    while at >= 0:
        starts.append(at)
        at = stream.find(b"\x00\x00\x01", at + 3)
    ends = [*starts[1:], len(stream)]
    return [stream[start + 3 : end].rstrip(b"\x00") for start, end in zip(starts, ends, strict=True)]


def pictures(stream):
    """NAL units of each picture; the stream has an access unit delimiter before every picture."""
    found = []
    for unit in nal_units(stream):
        if unit[0] & 0x1F == END_OF_ACCESS_UNIT:
            found.append([])
        else:
            found[-1].append(unit)
    return found


def payloads(unit):
    """RTP payloads of one NAL unit: itself, or fragments (FU-A)."""
    if len(unit) <= LARGEST_PACKET:
        return [unit]
    indicator, kind, body = unit[0] & 0xE0 | 28, unit[0] & 0x1F, unit[1:]
    pieces = [body[at : at + LARGEST_PACKET] for at in range(0, len(body), LARGEST_PACKET)]
    made = []
    for index, piece in enumerate(pieces):
        flags = (0x80 if index == 0 else 0) | (0x40 if index == len(pieces) - 1 else 0)
        made.append(bytes([indicator, flags | kind]) + piece)
    return made


class RtspServer:
    """Serves `stream` over and over.

    Args:
        stream: H.264, Annex B, access unit delimiters, its first picture an IDR with its parameter sets.
        rate_hz: pictures a second.
        extension: gives the RTP header extension of the next picture: its head (profile, length) included.
    """

    def __init__(self, stream, rate_hz, extension):
        self._pictures, self._rate_hz, self._extension = pictures(stream), rate_hz, extension
        self._sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
        for one in self._sockets:
            one.bind(("127.0.0.1", 0))
        self._client = None
        self._playing, self.frozen = threading.Event(), threading.Event()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()
        threading.Thread(target=self._stream, daemon=True).start()

    def _serve(self):
        while True:
            client, _ = self._server.accept()
            with client, client.makefile("rb") as lines, suppress(OSError):
                while self._answer(client, lines):
                    pass
            self._playing.clear()

    def _answer(self, client, lines):
        request = lines.readline().decode().split()
        if len(request) != 3:
            return False
        head = {}
        while line := lines.readline().strip():
            name, _, value = line.decode().partition(":")
            head[name.lower()] = value.strip()
        lines.read(int(head.get("content-length", 0)))
        method, url, _ = request
        more, body = [], ""
        if method == "OPTIONS":
            more = ["Public: OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, TEARDOWN, GET_PARAMETER"]
        elif method == "DESCRIBE":
            more, body = [f"Content-Base: {url}/", "Content-Type: application/sdp"], self._description()
        elif method == "SETUP":
            wanted = head["transport"].split(",")[0]
            ports = next(part for part in wanted.split(";") if part.startswith("client_port="))[12:].split("-")
            self._client = [int(port) for port in ports]
            ours = "-".join(str(one.getsockname()[1]) for one in self._sockets)
            more = [
                f"Transport: RTP/AVP;unicast;client_port={'-'.join(ports)};server_port={ours};ssrc=5348504C",
                "Session: 1;timeout=60",
            ]
        elif method == "PLAY":
            more = ["Session: 1", "Range: npt=now-"]
        status = ["RTSP/1.0 200 OK", f"CSeq: {head.get('cseq', 0)}", *more, f"Content-Length: {len(body)}", "", body]
        client.sendall("\r\n".join(status).encode())
        if method == "PLAY":
            self._playing.set()
        if method in ("PAUSE", "TEARDOWN"):
            self._playing.clear()
        return True

    def _description(self):
        return "\r\n".join([
            "v=0", "o=- 1 1 IN IP4 127.0.0.1", "s=Front camera", "c=IN IP4 0.0.0.0", "t=0 0", "a=control:*",
            "m=video 0 RTP/AVP 96", "a=rtpmap:96 H264/90000",
            "a=fmtp:96 packetization-mode=1" + self._parameter_sets(), "a=control:stream=0", "",
        ])  # fmt: skip

    def _parameter_sets(self):
        from base64 import b64encode

        sets = [unit for unit in self._pictures[0] if unit[0] & 0x1F in (7, 8)]
        return f";profile-level-id={sets[0][1:4].hex().upper()};sprop-parameter-sets=" + ",".join(
            b64encode(unit).decode() for unit in sets
        )

    def _stream(self):
        sequence, source = random.randrange(1 << 16), 0x5348504C
        due_s, last_report_s, sent, packets, octets = time.monotonic(), 0.0, 0, 0, 0
        while True:
            if not self._playing.is_set():
                self._playing.wait()
                due_s = time.monotonic()
            due_s += 1.0 / self._rate_hz
            time.sleep(max(0.0, due_s - time.monotonic()))
            if self.frozen.is_set():
                continue
            now_s = time.monotonic()
            stamp = int(now_s * CLOCK_HZ) & 0xFFFFFFFF
            rtp, rtcp = (("127.0.0.1", port) for port in self._client)
            if now_s - last_report_s > 0.5:
                last_report_s, wall_s = now_s, time.time() + NTP_EPOCH_S
                report = struct.pack(
                    ">BBHIIIIII", 0x80, 200, 6, source, int(wall_s), int(wall_s % 1 * (1 << 32)), stamp, packets,
                    octets & 0xFFFFFFFF,
                )  # fmt: skip
                self._sockets[1].sendto(report, rtcp)
            units = self._pictures[sent % len(self._pictures)]
            pieces = [piece for unit in units for piece in payloads(unit)]
            extension = self._extension()
            for index, piece in enumerate(pieces):
                more = extension if index == 0 else b""
                first, marker = 0x90 if more else 0x80, 0x80 if index == len(pieces) - 1 else 0
                head = struct.pack(">BBHII", first, marker | 96, sequence, stamp, source)
                sequence = (sequence + 1) & 0xFFFF
                packets, octets = packets + 1, octets + len(piece)
                self._sockets[0].sendto(head + more + piece, rtp)
            sent += 1
