"""Strangers who go round the misdeeds, one after the other, while soak.py churns its visitors.

Whoever has done one says no more, and must be answered and hung up. For what a thousand of them
leave behind: each counter and the log are compared with what was done.
"""

import collections
import concurrent.futures
import dataclasses
import http.client
import itertools
import pathlib
import re
import socket
import struct
import threading
import time
import urllib.parse
import urllib.request
from typing import Callable

from acts import Act
from misdeeds import SCRIPT, Misdeed

PACE_S = 0.4  # the log takes ten lines a second about refusals: refusals_per_second in server/base/log.cpp
# The longest of the server's limits is piece_timeout_s, 30 s; compilers may run beside it.
PATIENCE_S = 60.0
RESET = struct.pack("ii", 1, 0)  # of SO_LINGER


@dataclasses.dataclass
class Stranger:
    """Has done its misdeed."""

    misdeed: Misdeed
    connection: socket.socket
    due_s: float
    came: bytes = b""

    def hung_up(self) -> bool:
        """Takes what has come."""
        try:
            if self.misdeed.drips or not self.misdeed.reads:
                self.connection.send(b"x")
            if not self.misdeed.reads:
                return False
            if self.misdeed.sips:
                self.came += (sip := self.connection.recv(self.misdeed.sips))
                return not sip
            while chunk := self.connection.recv(1 << 16):
                self.came += chunk
        except BlockingIOError:
            return False
        except (ConnectionResetError, BrokenPipeError):
            pass
        return True

    def wrong(self) -> str:
        """Of what came until the end; empty: nothing is."""
        return "" if re.match(self.misdeed.answer, self.came, re.DOTALL) else f"was answered {self.came[-300:]!r}"


class Strangers:
    """As a context: go round until it is left, which waits until all are hung up."""

    def __init__(self, url: str, path: pathlib.Path, misdeeds: list[Misdeed], patience_s: float = PATIENCE_S,
                 acts: list[Act] | None = None):
        parts = urllib.parse.urlsplit(url)
        self.address = (parts.hostname, parts.port)
        self.path = path  # of the names of what was done to this process, by earlier runs too
        self.misdeeds, self.patience_s, self.acts = misdeeds, patience_s, acts or []
        self.there: list[Stranger] = []
        self.wrong: dict[str, list[str]] = {}
        self.stopped = threading.Event()
        self.pool = concurrent.futures.ThreadPoolExecutor(1)
        self.work: concurrent.futures.Future | None = None

    def __enter__(self) -> "Strangers":
        self.work = self.pool.submit(self._go_round)
        return self

    def __exit__(self, *_) -> None:
        self.stopped.set()
        self.work.result()
        self.pool.shutdown()

    def errors(self) -> list[str]:
        return [f"stranger, {name}: {what[0]}{f' ({len(what)} times)' if len(what) > 1 else ''}"
                for name, what in self.wrong.items()]

    def done(self) -> dict[str, int]:
        """How often, by name."""
        names = self.path.read_text("utf-8").splitlines() if self.path.exists() else []
        return dict(collections.Counter(names))

    def lines(self) -> collections.Counter[str]:
        """That they make in the log."""
        return self._effects(lambda misdeed: (misdeed.line,) * misdeed.lines if misdeed.line else ())

    def more_lines(self) -> collections.Counter[str]:
        """That may be in the log besides."""
        return self._effects(lambda misdeed: (misdeed.line,) * misdeed.more_lines)

    def moves(self) -> collections.Counter[str]:
        """What they add to counters."""
        return self._effects(lambda misdeed: misdeed.moves)

    def _effects(self, of: Callable[[Misdeed | Act], tuple[str, ...]]) -> collections.Counter[str]:
        done = self.done()
        effects: collections.Counter[str] = collections.Counter()
        for misdeed in [*self.misdeeds, *self.acts]:
            for effect in of(misdeed):
                effects[effect] += done.get(misdeed.name, 0)
        return effects

    def _go_round(self) -> None:
        for misdeed in itertools.cycle([*self.misdeeds, *self.acts]):
            try:
                self._note(misdeed.name)
                if isinstance(misdeed, Act):
                    self._complain(misdeed, misdeed.act(self.address))
                else:
                    self._do(misdeed)
            except (OSError, http.client.HTTPException) as error:
                self._complain(misdeed, str(error))
            self._look()
            if self.stopped.wait(PACE_S):
                break
        while self.there:
            time.sleep(PACE_S)
            self._look()

    def _note(self, name: str) -> None:
        with self.path.open("a", encoding="utf-8") as file:
            file.write(name + "\n")

    def _do(self, misdeed: Misdeed) -> None:
        sends = misdeed.sends
        if (wanted := SCRIPT.encode()) in sends:
            sends = sends.replace(wanted, self._script())
        for _ in range(misdeed.times):
            connection = socket.socket()
            connection.settimeout(10.0)
            if misdeed.sips or not misdeed.reads:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_MAXSEG, 536)
            connection.connect(self.address)
            connection.sendall(sends)
            connection.setblocking(False)
            if misdeed.resets:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
            if misdeed.resets or misdeed.closes:
                connection.close()
            else:
                self.there.append(Stranger(misdeed, connection, time.monotonic() + self.patience_s))

    def _script(self) -> bytes:
        host, port = self.address
        with urllib.request.urlopen(f"http://{host}:{port}/", timeout=10.0) as page:
            if found := re.search(rb'src="\.([^"]+\.js)"', page.read()):
                return found.group(1)
        raise OSError("the server has no page: configure with -DCATGS_WEB=ON")

    def _look(self) -> None:
        for stranger in self.there[:]:
            if stranger.hung_up():
                what = stranger.wrong()
            elif time.monotonic() > stranger.due_s:
                what = f"was not hung up after {self.patience_s:.0f} s: {stranger.came[-300:]!r}"
            else:
                continue
            stranger.connection.close()
            self.there.remove(stranger)
            self._complain(stranger.misdeed, what)

    def _complain(self, misdeed: Misdeed | Act, what: str) -> None:
        if what:
            self.wrong.setdefault(misdeed.name, []).append(what)
