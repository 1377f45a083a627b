#!/usr/bin/env python3
"""Runs a server and a load generator at the two ends of a line that loses real packets.

  line.py --rtt 50 --loss 1 [--rate 20] [--queue 200] [--seed 1] [--congestion cubic]
          --server "catgs-server synth:city:300000 --open --port 8080 --bind 10.77.0.1"
          -- catgs-load --url ws://10.77.0.1:8080 --sessions 1 --duration 60s

The ends are network namespaces of this run, joined by two TUN devices. Packets between them wait
for the line's rate in a queue that drops what does not fit. Then they are lost at random or arrive
half a round trip later. So both kernels' TCP does what it does on such a line. It needs root.
"""

import argparse
import contextlib
import fcntl
import heapq
import os
import random
import select
import shlex
import struct
import subprocess
import sys
import threading
import time

TUNSETIFF = 0x400454CA
IFF_TUN = 0x0001
IFF_NO_PI = 0x1000
MTU_BYTES = 1500
ADDRESSES = ("10.77.0.1", "10.77.0.2")
DEVICES = (f"line{os.getpid()}s", f"line{os.getpid()}l")  # of the server, of the load


class Direction:
    """One way of the line. Times are seconds."""

    def __init__(self, line: argparse.Namespace, random_source: random.Random) -> None:
        self.delay = line.rtt / 2000
        self.loss = line.loss / 100
        self.seconds_per_byte = 8e-6 / line.rate if line.rate > 0 else 0.0
        self.queue = line.queue / 1000
        self.random = random_source
        self.free_at = 0.0

    def arrival(self, size: int, now: float) -> float | None:
        """When a packet of `size` bytes arrives; None: it is dropped or lost."""
        start = max(now, self.free_at)
        if start - now > self.queue:
            return None
        self.free_at = start + size * self.seconds_per_byte
        if self.random.random() < self.loss:
            return None
        return self.free_at + self.delay


class Line(threading.Thread):
    """Carries packets between two TUN devices until it is stopped."""

    def __init__(self, ends: list[int], directions: list[Direction]) -> None:
        super().__init__(daemon=True)
        self.ends = ends
        self.directions = directions
        self.stopping = threading.Event()

    def run(self) -> None:
        under_way: list[tuple[float, int, int, bytes]] = []  # arrival, number, end, packet
        number = 0
        while not self.stopping.is_set():
            wait = max(under_way[0][0] - time.monotonic(), 0.0) if under_way else 0.1
            for end in select.select(self.ends, [], [], min(wait, 0.1))[0]:
                side = self.ends.index(end)
                packet = os.read(end, 2 * MTU_BYTES)
                at = self.directions[side].arrival(len(packet), time.monotonic())
                if at is not None:
                    number += 1
                    heapq.heappush(under_way, (at, number, self.ends[1 - side], packet))
            while under_way and under_way[0][0] <= time.monotonic():
                _, _, end, packet = heapq.heappop(under_way)
                with contextlib.suppress(OSError):  # the other end's namespace is going
                    os.write(end, packet)


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


def make_end(side: int, namespace: str) -> int:
    """A TUN device in a namespace of its own; the descriptor stays here."""
    device = DEVICES[side]
    descriptor = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(descriptor, TUNSETIFF, struct.pack("16sH", device.encode(), IFF_TUN | IFF_NO_PI))
    ip("netns", "add", namespace)
    ip("link", "set", "dev", device, "netns", namespace)
    ip("-n", namespace, "link", "set", "lo", "up")
    ip("-n", namespace, "addr", "add", ADDRESSES[side], "peer", ADDRESSES[1 - side], "dev", device)
    ip("-n", namespace, "link", "set", "dev", device, "mtu", str(MTU_BYTES), "up")
    return descriptor


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rtt", type=float, required=True, help="round trip without queues, ms")
    parser.add_argument("--loss", type=float, required=True, help="of packets each way, percent")
    parser.add_argument("--rate", type=float, default=0, help="Mbit/s each way; 0: no bound")
    parser.add_argument("--queue", type=float, default=200, help="of the bottleneck, ms")
    parser.add_argument("--seed", type=int, default=1, help="of the losses")
    parser.add_argument("--congestion", 
                        help="of the server's sockets that ask for none, such as cubic")
    parser.add_argument("--server", required=True)
    parser.add_argument("load", nargs="+", metavar="-- LOAD")
    line = parser.parse_args()

    namespaces = [f"catgs-{os.getpid()}-{name}" for name in ("server", "load")]
    server = carrier = None
    try:
        ends = [make_end(side, name) for side, name in enumerate(namespaces)]
        source = random.Random(line.seed)
        carrier = Line(ends, [Direction(line, source) for _ in ends])
        carrier.start()
        enter = [["ip", "netns", "exec", name] for name in namespaces]
        if line.congestion:
            ip("-n", namespaces[0], "route", "change", ADDRESSES[1], "dev", DEVICES[0],
               "congctl", line.congestion)
        server = subprocess.Popen([*enter[0], *shlex.split(line.server)])
        time.sleep(2)
        return subprocess.run([*enter[1], *line.load], check=False).returncode
    finally:
        if server:
            server.terminate()
            server.wait()
        if carrier:
            carrier.stopping.set()
            carrier.join()
        for name in namespaces:
            subprocess.run(["ip", "netns", "del", name], check=False)


if __name__ == "__main__":
    sys.exit(main())
