"""An adapter between tactile-lab and an arm of your own: a program that speaks the positioner protocol.

    python positioner_server.py [ADDRESS] [PORT]

A datagram of 52 bytes, little-endian, comes for every cycle of a session: a number and six targets, x, y, z in metres
and yaw, pitch, roll in radians, in the frame of the arm's mount. Each is answered by its own number and where the arm
stands now. Number 0 is a question and moves nothing. Targets lie within the rig file's limits of range and speed.

Replace ``Arm`` by calls to your arm's own interface. Keep two things: it stops by itself when no command has come for
``SILENCE_s``, whatever this program does, and it tells where it *stands*, not where it was sent.
"""

import socket
import struct
import sys
import time

MESSAGE = struct.Struct("<I6d")
SILENCE_s = 0.2
CYCLE_s = 0.005
LARGEST_STEP = (0.5, 0.5, 0.5, 2.5, 2.5, 2.5)  # metres and radians a second


class Arm:
    """An arm without a body: it goes to its target at a limited speed."""

    def __init__(self):
        self.place = [0.0, 0.0, 0.3, 0.0, 0.0, 0.0]
        self.target = list(self.place)
        self.commanded_s = time.monotonic()

    def command(self, target):
        self.target, self.commanded_s = list(target), time.monotonic()

    def step(self, duration_s):
        """One cycle of your controller. Without commands it stays where it is."""
        if time.monotonic() - self.commanded_s > SILENCE_s:
            self.target = list(self.place)
        for axis, speed in enumerate(LARGEST_STEP):
            way = self.target[axis] - self.place[axis]
            self.place[axis] += max(-speed * duration_s, min(speed * duration_s, way))


def answer(arm, message):
    """The status that answers a message; None for what is no command."""
    if len(message) != MESSAGE.size:
        return None
    number, *target = MESSAGE.unpack(message)
    if number and all(abs(value) < 100.0 for value in target):
        arm.command(target)
    return MESSAGE.pack(number, *arm.place)


def serve(address, port):
    """Answer commands and step the arm, for ever."""
    arm = Arm()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind((address, port))
        wire.settimeout(CYCLE_s)
        print(f"positioner at {address}:{wire.getsockname()[1]}", flush=True)
        stepped_s = time.monotonic()
        while True:
            try:
                message, client = wire.recvfrom(1000)
            except TimeoutError:
                message = b""
            now_s = time.monotonic()
            arm.step(now_s - stepped_s)
            stepped_s = now_s
            if status := answer(arm, message):
                wire.sendto(status, client)


if __name__ == "__main__":
    serve(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1", int(sys.argv[2]) if len(sys.argv) > 2 else 49200)
