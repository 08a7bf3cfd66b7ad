"""Fills a SocketCAN bus: `send_paced.py CHANNEL BITRATE SECONDS LENGTH` prints frames and bits sent as JSON.

A kernel may wake it only every 10 ms, so each time it sends all that is due by then. Frames are the robot's messages of
LENGTH bytes or more with random data, each counted with its stuff bits.
"""

from __future__ import annotations

import errno
import json
import random
import socket
import struct
import sys
import time

from eurobot_od.bus import frame_bits
from eurobot_od.frame import Frame
from eurobot_od.robot.protocol import EurobotProtocol

DIFFERENT = 1000
"""Different frames; they are sent again and again."""

PAUSE = 0.001
FRAME = struct.Struct("=IB3x8s")
"""Linux's `struct can_frame`."""


def made_frames(shortest: int) -> list[tuple[bytes, int]]:
    """Make the frames as the socket takes them, each with its number of bits on the bus."""
    chance = random.Random(1)
    made = []
    bindings = [each for each in EurobotProtocol.load().bindings if each.layout.length >= shortest]
    for binding in chance.choices(bindings, k=DIFFERENT):
        data = chance.randbytes(binding.layout.length)
        made.append((FRAME.pack(binding.cob_id, len(data), data), frame_bits(Frame(binding.cob_id, data))))
    return made


def fill(bus: socket.socket, bitrate: float, seconds: float, shortest: int) -> tuple[int, int]:
    """Send what is due until the time is over; return frames and bits."""
    frames = made_frames(shortest)
    sent = 0
    bits = 0
    begin = time.monotonic()
    while (passed := time.monotonic() - begin) < seconds:
        while bits < passed * bitrate:
            data, length = frames[sent % DIFFERENT]
            _send(bus, data)
            sent, bits = sent + 1, bits + length
        time.sleep(PAUSE)
    return sent, bits


def _send(bus: socket.socket, data: bytes) -> None:
    while True:
        try:
            bus.send(data)
            return
        except OSError as error:
            if error.errno != errno.ENOBUFS:
                raise
            time.sleep(PAUSE)


def main() -> None:
    """Fill the bus."""
    channel = sys.argv[1]
    bitrate = float(sys.argv[2])
    seconds = float(sys.argv[3])
    shortest = int(sys.argv[4])
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
        bus.bind((channel,))
        sent, bits = fill(bus, bitrate, seconds, shortest)
    print(json.dumps({"frames": sent, "bits": bits}))


if __name__ == "__main__":
    main()
