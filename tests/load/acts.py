"""What strangers do to a server in several steps, for strangers.py: each answer decides the next step."""

import concurrent.futures
import http.client
import json
import socket
import time
from typing import Callable, Iterator, NamedTuple

from misdeeds import BINARY, BYE, CLOSE, FILM, SIDECAR, field, frame, hello, upgrade

Address = tuple[str, int]
PATIENCE_S = 20.0
TOURS = "/api/scenes/hall/tours"
ORDERS = 10
FLOOD_MESSAGES = 400  # fewer than a connection may send at once
WATCH_TOKEN, WELCOME = 9, 1  # fields of proto/catgs.proto


class Act(NamedTuple):
    """Moves no counter that is judged."""

    name: str
    act: Callable[[Address], str]  # says what was wrong; empty: nothing
    line: str = ""  # that it makes in the log, so often
    lines: int = 1
    more_lines: int = 0  # that may come besides, where the server stalls
    moves: tuple[str, ...] = ()


class Answer(NamedTuple):
    status: int
    tag: str
    body: bytes


def ask(address: Address, link: str, method: str, path: str, body: str = "", if_match: str = "") -> Answer:
    connection = http.client.HTTPConnection(*address, timeout=PATIENCE_S)
    headers = {"Authorization": f"Bearer {link}"} | ({"If-Match": if_match} if if_match else {})
    try:
        connection.request(method, path, body or None, headers)
        answer = connection.getresponse()
        return Answer(answer.status, answer.headers.get("ETag", ""), answer.read())
    finally:
        connection.close()


def unexpected(answers: list[Answer], wanted: set[int]) -> str:
    return ", ".join(f"{a.status}: {a.body[:100]!r}" for a in answers if a.status not in wanted)


def two_authors_save(address: Address, link: str) -> str:
    """Both have seen what is there, and both save at the same moment."""
    tag = json.loads(ask(address, link, "GET", TOURS).body)["document"]["etag"]

    def save(z: int) -> Answer:
        stop = {"position": [0, 0, z], "look_at": [0, 0, 9]}
        tours = {"tours": [{"title": f"of author {z} at {time.time_ns()}", "stops": [stop]}]}
        return ask(address, link, "PUT", SIDECAR, json.dumps(tours), tag or '"none"')

    with concurrent.futures.ThreadPoolExecutor(2) as authors:
        answers = list(authors.map(save, (1, 2)))
    if all(answer.status == 200 for answer in answers):
        return f"both saves over {tag} were taken"
    return unexpected(answers, {200, 412, 503})


def order_and_cancel(address: Address, link: str) -> str:
    # So long that none ends before it is cancelled.
    order = json.dumps({"kind": "film", "size": [320, 180], "views": [[0, 0, 0, 0, 0, 0, 1, 60], 1800]})
    wrong = ""
    for _ in range(ORDERS):
        ordered = ask(address, link, "PUT", FILM, order)
        wrong = wrong or unexpected([ordered], {202, 409, 503})
        if ordered.status == 202:
            job = json.loads(ordered.body)["id"]
            wrong = wrong or unexpected([ask(address, link, "PUT", f"/api/films/{job}/cancel", " ")], {200, 503})
    return wrong


class Visit:
    """A websocket that reads frames, without the masks that servers do not use."""

    def __init__(self, address: Address, greeting: bytes):
        self.socket = socket.create_connection(address, PATIENCE_S)
        self.socket.sendall(upgrade())
        self.came = b""
        while b"\r\n\r\n" not in self.came:
            self._receive()
        self.came = self.came.split(b"\r\n\r\n", 1)[1]
        self.say([greeting])

    def _receive(self) -> None:
        if not (chunk := self.socket.recv(1 << 16)):
            raise ConnectionError("hung up without a farewell")
        self.came += chunk

    def _take(self, count: int) -> bytes:
        while len(self.came) < count:
            self._receive()
        taken, self.came = self.came[:count], self.came[count:]
        return taken

    def frames(self) -> Iterator[tuple[int, bytes]]:
        """First byte and payload, up to the close frame."""
        first = 0
        while first != CLOSE:
            first, size = self._take(2)
            if size == 126:
                size = int.from_bytes(self._take(2), "big")
            elif size == 127:
                size = int.from_bytes(self._take(8), "big")
            yield first, self._take(size)

    def say(self, messages: list[bytes]) -> None:
        self.socket.sendall(b"".join(frame(BINARY, message) for message in messages))

    def __enter__(self) -> "Visit":
        return self

    def __exit__(self, *_) -> None:
        self.socket.close()

    def farewell(self) -> bytes:
        self.say([field(9, b"")])
        return [payload for _, payload in self.frames()][-1]


def text_field(message: bytes, wanted: int) -> bytes | None:
    """Of a protobuf message; the first one of that number."""
    at = 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at, value, shift = at + 1, value | (byte & 127) << shift, shift + 7
            if byte < 128:
                return value

    while at < len(message):
        number, kind = divmod(varint(), 8)
        if kind == 2:
            size = varint()
            if number == wanted:
                return message[at:at + size]
            at += size
        elif kind == 0:
            varint()
        else:
            at += 4 if kind == 5 else 8
    return None


def welcome_of(visit: Visit) -> bytes:
    for first, payload in visit.frames():
        welcome = text_field(payload[1:], WELCOME) if first == BINARY and payload[:1] == b"\1" else None
        if welcome is not None:
            return welcome
    raise ConnectionError("closed without a welcome")


def lead_in_a_flood(address: Address, link: str) -> str:
    """One follows, and the leader's camera moves as often as messages may come."""
    poses = [field(2, field(1, i + 1) + field(2, 1000 * i) + field(4, 1.0) +
                   field(3, field(1, field(1, i / 100.0)) + field(2, field(4, 1.0)))) for i in range(FLOOD_MESSAGES)]
    with Visit(address, hello(b"", link=link)) as leader:
        watch = text_field(welcome_of(leader), WATCH_TOKEN) or b""
        leader.say([field(11, field(1, 1) + field(2, "leader"))])
        with Visit(address, hello(field(10, watch) + field(11, 1), link=link)) as follower:
            leader.say(poses)
            return closed_otherwise(follower.farewell(), leader.farewell())


def closed_otherwise(*ends: bytes) -> str:
    return "" if all(end == BYE for end in ends) else f"were closed with {ends}"


def says_and_leaves(address: Address, link: str, messages: list[bytes]) -> str:
    with Visit(address, hello(b"", link=link)) as visit:
        visit.say(messages)
        return closed_otherwise(visit.farewell())


def all_acts(link: str = "") -> list[Act]:
    """At a server that asks for no tokens, or at one where `link` is an author's."""
    stops = [field(13, field(1, i % 32) + field(2, i % 256)) for i in range(FLOOD_MESSAGES)]
    # Of those that begin, eight may come at once: shared_tours in server/visit/session.h.
    # The others are refused once a second, so a flood makes one line, and two when it is held up.
    presents = [field(11, field(1, on) + field(2, f"leader {i}")) for i in range(20) for on in (1, 0)]
    acts = [Act("forged stops", lambda address: says_and_leaves(address, link, stops)),
            Act("presents without end", lambda address: says_and_leaves(address, link, presents),
                "127.0.0.1: shared tours begin twice a second at most: try again in a moment", more_lines=1),
            Act("leads in a flood", lambda address: lead_in_a_flood(address, link))]
    if link:
        acts += [Act("two authors save", lambda address: two_authors_save(address, link)),
                 Act("orders and cancels", lambda address: order_and_cancel(address, link))]
    return acts
