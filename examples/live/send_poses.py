#!/usr/bin/env python3
"""Sends poses to a ghand viewer that was started with --live.

    python3 send_poses.py                          a hand whose fingers curl, through WebSocket
    python3 send_poses.py --udp --rate 120         the same in datagrams
    python3 send_poses.py poses.json --loop        the frames of a JSON or JSON Lines file

A packet is one frame as JSON; docs/poses.md lists the forms. Needs nothing but Python 3.
"""

import argparse
import base64
import json
import math
import os
import socket
import struct
import sys
import time

FINGERS = ["thumb", "index-finger", "middle-finger", "ring-finger", "pinky-finger"]
PARTS = ["metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"]
# Lengths of the bones from the wrist to the tip, metres.
LENGTHS = [0.06, 0.035, 0.03, 0.025, 0.02]


class Udp:
    """Packets as datagrams."""

    def __init__(self, port):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.address = ("127.0.0.1", port)

    def send(self, text):
        self.socket.sendto(text.encode(), self.address)

    def close(self):
        self.socket.close()


class WebSocket:
    """The sending half of RFC 6455."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=5)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        key = base64.b64encode(os.urandom(16)).decode()
        request = (
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        self.socket.sendall(request.encode())
        answer = b""
        while b"\r\n\r\n" not in answer:
            part = self.socket.recv(4096)
            if not part:
                break
            answer += part
        if b" 101 " not in answer.split(b"\r\n")[0]:
            raise OSError(f"the viewer did not accept the connection: {answer.decode(errors='replace').strip()!r}")

    def send(self, text):
        self._frame(0x1, text.encode())

    def close(self):
        self._frame(0x8, struct.pack(">H", 1000))
        self.socket.close()

    def _frame(self, kind, payload):
        size = len(payload)
        if size < 126:
            head = struct.pack(">BB", 0x80 | kind, 0x80 | size)
        elif size < 65536:
            head = struct.pack(">BBH", 0x80 | kind, 0x80 | 126, size)
        else:
            head = struct.pack(">BBQ", 0x80 | kind, 0x80 | 127, size)
        # A client must mask what it sends; a mask of zeros leaves it as it is.
        self.socket.sendall(head + bytes(4) + payload)


def product(a, b):
    """Product of two quaternions (x, y, z, w)."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]


def about(axis, angle):
    """The rotation about x (0), y (1) or z (2) by an angle in radians."""
    quaternion = [0.0, 0.0, 0.0, math.cos(angle / 2)]
    quaternion[axis] = math.sin(angle / 2)
    return quaternion


def forward(turn):
    """Where a joint's bone points: along its -z."""
    x, y, z, w = turn
    return [-2 * (x * z + w * y), -2 * (y * z - w * x), -(1 - 2 * (x * x + y * y))]


def curling_fingers(seconds):
    """A WebXR frame of a right hand that points up and shows its back; its fingers curl one after the other."""
    # Fingers up, and a little from side to side.
    wrist = product(about(1, 0.4 * math.sin(0.7 * seconds)), about(0, math.pi / 2))
    joints = {"wrist": {"position": [0.0, 1.2, -0.4], "orientation": wrist}}
    for number, finger in enumerate(FINGERS):
        bend = 0.5 - 0.5 * math.cos(2.0 * seconds - 0.6 * number)
        spread = 0.22 * (2 - number)
        turn = product(wrist, about(1, 0.8 if number == 0 else spread))
        if number == 0:
            turn = product(turn, about(2, 0.9))
        place = joints["wrist"]["position"]
        for part, length in zip(PARTS, LENGTHS):
            if number == 0 and part == "phalanx-intermediate":
                continue
            if part.startswith("phalanx"):
                turn = product(turn, about(0, (-0.5 if number == 0 else -1.3) * bend))
            place = [p + length * d for p, d in zip(place, forward(turn))]
            joints[f"{finger}-{part}"] = {"position": place, "orientation": turn}
    return {"handedness": "right", "joints": joints}


def file_packets(path):
    """The rate of a file, if it has one, and its frames as packets."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    try:
        content = json.loads(text)
    except json.JSONDecodeError:
        content = [json.loads(line) for line in text.splitlines() if line.strip()]
    if not isinstance(content, dict):
        content = {"frames": content}
    if not isinstance(content.get("frames"), list):
        return None, [content]
    shared = {name: value for name, value in content.items() if name not in ("frames", "fps", "format", "version")}
    return content.get("fps"), [{**shared, "frames": [frame]} for frame in content["frames"]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="?", help="a JSON or JSON Lines file of poses [default: curling fingers]")
    parser.add_argument("--port", type=int, default=4263, help="[default: 4263]")
    parser.add_argument("--udp", action="store_true", help="send datagrams instead of using WebSocket")
    parser.add_argument("--rate", type=float, help="packets per second [default: the file's, else 60]")
    parser.add_argument("--seconds", type=float, help="stop after this time [default: end of the file, or never]")
    parser.add_argument("--loop", action="store_true", help="begin again at the end of the file")
    arguments = parser.parse_args()
    rate, packets = file_packets(arguments.file) if arguments.file else (None, None)
    rate = arguments.rate or rate or 60.0
    sender = Udp(arguments.port) if arguments.udp else WebSocket(arguments.port)
    start, count = time.monotonic(), 0
    try:
        while arguments.seconds is None or count < arguments.seconds * rate:
            if packets and count >= len(packets) and not arguments.loop:
                break
            time.sleep(max(0.0, start + count / rate - time.monotonic()))
            packet = dict(packets[count % len(packets)]) if packets else curling_fingers(count / rate)
            packet["sent_ms"] = 1000.0 * time.time()
            sender.send(json.dumps(packet))
            count += 1
    except KeyboardInterrupt:
        pass
    finally:
        sender.close()
        print(f"{count} packets in {time.monotonic() - start:.1f} s", file=sys.stderr)


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
