"""What HAProxy, as it is configured here, gives to the connections of one address."""

import contextlib
import re
import socket
import subprocess
import time

CROWD, OF_AN_ADDRESS = 1100, 1024


def findings(haproxy, config):
    """One address holds its connections, and another one is still served. The servers may be absent."""
    port = free_port()
    text = re.sub(r"^frontend stats[\s\S]*$", "", config.read_text(), flags=re.M)
    text = re.sub(r"maxconn (20|4)000", "maxconn 2500", text)  # each may take two descriptors
    text = re.sub(r"bind :(80|8080)$", f"bind 127.0.0.1:{port}", text, flags=re.M)
    config.write_text(re.sub(r"bind :443", f"bind 127.0.0.1:{free_port()}", text))
    with subprocess.Popen([haproxy, "-db", "-f", str(config)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as proxy:
        try:
            wait_for_port(port)
            with contextlib.ExitStack() as crowd:
                members = []
                for _ in range(CROWD):
                    with contextlib.suppress(ConnectionResetError):
                        member = socket.create_connection(("127.0.0.1", port), 10, ("127.0.0.2", 0))
                        members.append(crowd.enter_context(member))
                with socket.create_connection(("127.0.0.1", port), 10, ("127.0.0.3", 0)) as another:
                    another.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
                    served = another.recv(100).startswith(b"HTTP/1.1 ")
                for _ in range(100):  # refusals take a moment to arrive
                    if (held := sum(is_open(member) for member in members)) <= OF_AN_ADDRESS:
                        break
                    time.sleep(0.05)
        finally:
            proxy.terminate()
    wrong = [] if served else ["one address keeps others out"]
    # A limit of its rate may allow fewer.
    return wrong if OF_AN_ADDRESS // 2 <= held <= OF_AN_ADDRESS else [*wrong, f"one address holds {held} connections"]


def is_open(connection):
    connection.settimeout(0)
    try:
        return bool(connection.recv(1))
    except BlockingIOError:
        return True
    except OSError:
        return False


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for_port(port):
    for _ in range(100):
        with contextlib.suppress(OSError):
            socket.create_connection(("127.0.0.1", port), 1).close()
            return
        time.sleep(0.05)
    raise RuntimeError(f"nobody listens on port {port}")
