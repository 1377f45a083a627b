"""What strangers do to a server, for strangers.py.

Each misdeed has the answer that it must get, the line that it writes into the log and the counters
that it moves. They are those of a server that listens on a loopback address. tests/server/net tests
each of them once, and many more.
"""

import itertools
import re
import struct
from typing import NamedTuple

REQUESTS, SESSIONS, MESSAGES = ("catgs_requests_refused_total", "catgs_sessions_refused_total",
                                "catgs_bad_messages_total")
TEXT, FRAGMENT, BINARY, CLOSE, PING, PONG = 0x81, 0x02, 0x82, 0x88, 0x89, 0x8a  # first bytes of frames, RFC 6455
BAD_MESSAGE, UNAUTHORIZED, UNKNOWN_SCENE, RATE_LIMITED = 1, 2, 3, 7  # of proto/catgs.proto
NOTHING = rb"\Z"
NOTHING_OR_FULL = rb"\Z|HTTP/1\.1 503 "  # of an upload, by whether others hold all places
FLOOD_FRAMES = 400_000  # of 6 bytes: 2.3 MiB, where 1.8 may come within a second
SCRIPT = "/the/page's/script.js"  # whose name has a digest
SIDECAR = "/api/scenes/hall/sidecar"  # of a scene that authors save, where there are authors
FILM = "/api/scenes/hall/films"
SAVES, SAVED_BYTES = 50, 958_000
HIDDEN = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"  # where the body of another request is


class Misdeed(NamedTuple):
    name: str
    sends: bytes
    answer: bytes  # a regular expression, of what comes before the server hangs up
    line: str = ""
    moves: tuple[str, ...] = ()
    resets: bool = False  # does not wait for an answer
    reads: bool = True  # otherwise it has a small receive buffer, reads nothing and keeps sending
    closes: bool = False  # the same, but all that was sent arrives
    times: int = 1  # on one connection after the other
    drips: bool = False  # sends a byte more at each look
    sips: int = 0  # takes so many bytes at each look; 0: all
    lines: int = 1  # so many of `line`
    more_lines: int = 0  # that may come besides


def request(method: str, path: str = "/", headers: str = "", body: str = "", host: str = "localhost") -> bytes:
    return f"{method} {path} HTTP/1.1\r\nHost: {host}\r\n{headers}\r\n{body}".encode()


def upgrade(frames: bytes = b"", headers: str = "", version: int = 13) -> bytes:
    return request("GET", headers="Connection: Upgrade\r\nUpgrade: websocket\r\n"
                   f"Sec-WebSocket-Version: {version}\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                   f"Sec-WebSocket-Protocol: catgs.v1\r\n{headers}") + frames


def frame(first: int, payload: bytes, mask: bytes = b"\x12\x34\x56\x78") -> bytes:
    """Of a client; with an empty mask of the server."""
    size = len(payload)
    head = (struct.pack(">B", size) if size < 126 else struct.pack(">BH", 126, size) if size < 1 << 16
            else struct.pack(">BQ", 127, size))
    head = bytes([first, head[0] | (0x80 if mask else 0)]) + head[1:] + mask
    return head + (bytes(a ^ b for a, b in zip(payload, itertools.cycle(mask))) if mask else payload)


def field(number: int, value: int | float | bytes | str) -> bytes:
    """Of a protobuf message."""
    def varint(rest: int) -> bytes:
        return bytes([rest]) if rest < 128 else bytes([rest & 127 | 128]) + varint(rest >> 7)
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    if isinstance(value, float):
        return varint(number << 3 | 5) + struct.pack("<f", value)
    value = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(value)) + value


def hello(more: bytes, width_px: int = 64, link: str = "") -> bytes:
    token = field(7, link) if link else b""
    return field(1, field(1, 1) + field(3, width_px) + field(4, 64) + field(5, 1.0) + field(6, b"\1\2") + token + more)


def refused(name: str, sends: bytes, status: int, why: str) -> Misdeed:
    """A request, by the server: it counts and logs that."""
    return Misdeed(name, sends, rb"HTTP/1\.[01] %d " % status, f"127.0.0.1: {why}", (REQUESTS,))


def closed(name: str, frames: bytes, code: int, why: str, error: int | None = None, bad: bool = True) -> Misdeed:
    """A websocket, by a close frame, which the message Error comes before."""
    said = b"" if error is None else frame(
        BINARY, b"\x01" + field(6, field(1, error) + field(2, why) + field(3, 1)), b"")
    said += frame(CLOSE, struct.pack(">H", code) + why.encode(), b"")
    return Misdeed(name, upgrade(frames), rb"HTTP/1\.1 101 .*" + re.escape(said), f"127.0.0.1: {why}",
                   (SESSIONS, MESSAGES) if bad else (SESSIONS,))


def flood(name: str, first: int) -> Misdeed:
    """Of empty control frames. The fragment before them takes the place of the bytes that came with the
    request and that libwebsockets 4.1.6 writes its answer over."""
    return closed(name, frame(FRAGMENT, b"x" * 1000) + frame(first, b"") * FLOOD_FRAMES, 1008, "too many messages",
                  RATE_LIMITED, bad=False)


BYE = struct.pack(">H", 1000) + b"bye"
NO_HTTP = rb"HTTP/1\.0 403 "  # libwebsockets' own answer, which nothing counts
ONE_ANSWER = rb"HTTP/1\.1 404 (?:(?!HTTP/1\.).)*\Z"  # connection: close, whatever is behind the request
NO_CLIENT_MESSAGE = "message: not a ClientMessage of catgs.v1"
MISDEEDS = [
    refused("foreign Host", request("GET", host="evil.example"), 403,
            "request refused: this server is not known as evil.example (--allow-origin)"),
    refused("websocket of a foreign Origin", upgrade(headers="Origin: https://evil.example\r\n"), 403,
            "websocket refused: origin https://evil.example is not allowed at localhost (--allow-origin)"),
    refused("websocket of version 7", upgrade(version=7), 400,
            "request refused: 400: open websockets by GET, Sec-WebSocket-Version 13"),
    refused("h2c", request("GET", headers="Connection: Upgrade\r\nUpgrade: h2c\r\n"), 400,
            "request refused: 400: HTTP/1.1 and websockets are spoken here, not h2c"),
    refused("sidecar of a foreign Origin", request("PUT", SIDECAR, "Content-Length: 2\r\nOrigin: null\r\n", "{}"), 403,
            "upload refused: origin null is not allowed at localhost (--allow-origin)"),
    refused("sidecar of 99 MB", request("PUT", SIDECAR, "Content-Length: 99999999\r\n", "{"), 413,
            "upload refused: 413: send at most 1048576 bytes, not 99999999"),
    refused("save to an empty segment", request("PUT", "/api/scenes//sidecar", "Content-Length: 2\r\n", "{}"), 405,
            "upload refused: 405: only sidecars and media of scenes, and orders of films, are taken here"),
    Misdeed("empty and dot segments", request("GET", "/api//scenes/./%2f/tours"), rb"HTTP/1\.1 404 "),
    refused("GET with a body", request("GET", headers="Content-Length: 5\r\n", body="hello"), 413,
            "request refused: 413: a GET needs no body"),
    refused("chunks", request("GET", headers="Transfer-Encoding: chunked\r\n", body="0\r\n\r\n"), 411,
            "request refused: 411: Content-Length is needed, not Transfer-Encoding"),
    refused("POST", request("POST"), 405, "request refused: 405: only GET and HEAD are served here"),
    Misdeed("second request", request("GET", "/nowhere", body=HIDDEN), ONE_ANSWER),
    Misdeed("length before a space", request("GET", "/nowhere", f"Content-Length : {len(HIDDEN)}\r\n", HIDDEN),
            ONE_ANSWER),
    Misdeed("folded length", request("GET", "/nowhere", f"X: 1\r\n Content-Length: {len(HIDDEN)}\r\n", HIDDEN),
            ONE_ANSWER),
    Misdeed("length behind a bare CR", request("GET", "/nowhere", f"X: 1\rContent-Length: {len(HIDDEN)}\r\n", HIDDEN),
            ONE_ANSWER),
    Misdeed("chunks before a space", request("GET", "/nowhere", "Transfer-Encoding : chunked\r\n", HIDDEN), ONE_ANSWER),
    Misdeed("unread answer", request("GET", SCRIPT, body="x"), NOTHING, reads=False),
    Misdeed("answer in sips", request("GET", SCRIPT), rb"HTTP/1\.1 200 ", sips=512),
    Misdeed("path that climbs", request("GET", "/../../etc/passwd"), rb"HTTP/1\.1 404 "),
    Misdeed("encoded path that climbs", request("GET", "/%2e%2e%2f%2e%2e%2fetc%2fpasswd"), rb"HTTP/1\.1 404 "),
    Misdeed("unknown method", request("NONSENSE"), NO_HTTP),
    Misdeed("CONNECT", request("CONNECT"), NOTHING, "127.0.0.1: request refused: this is no proxy", (REQUESTS,)),
    Misdeed("junk", bytes(range(128, 256)) * 8, NO_HTTP),
    Misdeed("TLS", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(range(256)), NO_HTTP),
    Misdeed("endless head", request("GET", headers=f"Cookie: {'c' * 5000}\r\n"), NOTHING,
            "libwebsockets: Ran out of header data space", (REQUESTS,)),
    Misdeed("100 arguments", request("GET", "/?a" + 99 * "&a"), NOTHING,
            "libwebsockets: More hdr frags than we can deal with", (REQUESTS,)),
    Misdeed("half a head", request("GET")[:30], NOTHING),
    Misdeed("silence", b"", NOTHING),
    closed("junk in a message", frame(BINARY, b"\xff" * 40), 1008, NO_CLIENT_MESSAGE, BAD_MESSAGE),
    closed("frame without a mask", frame(BINARY, b"hello", b""), 1008, NO_CLIENT_MESSAGE, BAD_MESSAGE),
    closed("field out of range", frame(BINARY, hello(b"", 1)), 1008,
           "hello.viewport_width_px: 1 is not in 16…8192", BAD_MESSAGE),
    closed("message over 64 KiB", frame(BINARY, b"x" * 65537), 1009, "message over 64 KiB"),
    closed("text", frame(TEXT, b"hello"), 1003, "binary messages only"),
    closed("Pause before Hello", frame(BINARY, field(8, b"")), 1008, "the first message has to be a hello",
           BAD_MESSAGE),
    closed("no Hello", b"", 1008, "no hello within the time limit", BAD_MESSAGE),
    Misdeed("ping of 126 bytes", upgrade(frame(PING, b"p" * 126)), rb"HTTP/1\.1 101 .*\r\n\r\n\Z"),
    flood("flood of pings", PING),
    flood("flood of pongs", PONG),
    Misdeed("upgrade and reset", upgrade(), NOTHING, resets=True),
]


def put(headers: str, body: str) -> bytes:
    return request("PUT", SIDECAR, f"{headers}Content-Length: {len(body)}\r\n", body)


def by_access(link: str) -> list[Misdeed]:
    """Those whose answer is another one where tokens are asked for."""
    status, why = ((401, "this server needs an access token: open the link you were given") if link else
                   (403, "nobody can save on this server: it was started without --token-key-file, which links of "
                    "role author are made with"))
    no_save = f"upload refused: {status}: {why}"
    return [
        refused("sidecar without a token", put("", "{}"), status, no_save),
        Misdeed("sidecar that stays away", request("PUT", SIDECAR, "Content-Length: 99\r\n", "{"), NOTHING,
                f"127.0.0.1: {no_save}", (REQUESTS,)),
        closed("unknown scene", frame(BINARY, hello(field(2, "atlantis"), link=link)), 1008,
               'there is no scene "atlantis" here, or there are several of this name: ask for a new link', UNKNOWN_SCENE, bad=False),
        closed("unsigned link to watch", frame(BINARY, hello(field(10, "nobody.signed.this"), link=link)), 1008,
               "this link to watch a session is not valid here", UNAUTHORIZED, bad=False),
        # A new session: the token does no harm.
        Misdeed("unsigned resume token, Bye", upgrade(frame(BINARY, hello(field(8, field(1, "nobody.signed.this")),
                                                                          link=link)) + frame(BINARY, field(9, b""))),
                rb"HTTP/1\.1 101 .*" + re.escape(frame(CLOSE, BYE, b""))),
    ]


def by_authors(link: str) -> list[Misdeed]:
    """Large saves, many in quick succession whose answers nobody waits for, and uploads that hardly move."""
    token = f"Authorization: Bearer {link}\r\n"
    sidecar = '{"start_pose": {"position": [0, 0, 1], "look_at": [0, 0, 9]}}'.ljust(SAVED_BYTES)
    save, stale = put(token, sidecar), put(f'{token}If-Match: "stale"\r\n', sidecar)
    return [Misdeed("save", save, rb"HTTP/1\.1 200 "), Misdeed("stale save", stale, rb"HTTP/1\.1 412 "),
            Misdeed("saves without end", save, NOTHING, closes=True, times=SAVES),
            Misdeed("stale saves without end", stale, NOTHING, closes=True, times=SAVES),
            Misdeed("save in drips", request("PUT", SIDECAR, f"{token}Content-Length: {SAVED_BYTES}\r\n"),
                    NOTHING_OR_FULL, drips=True),
            Misdeed("film in drips", request("PUT", "/api/scenes/hall/media/a.mp4",
                                             f"{token}Content-Length: 60000000\r\n"), NOTHING_OR_FULL, drips=True)]


def all_misdeeds(link: str = "") -> list[Misdeed]:
    """At a server that asks for no tokens, or at one where `link` is an author's."""
    return MISDEEDS + by_access(link) + (by_authors(link) if link else [])
