#!/usr/bin/env python3
"""Runs a catgs-server behind the proxy configurations of deploy, with the proxy's own login where they have one.

  proxies.py nginx|caddy|haproxy SERVER    SERVER: catgs-server

Exit status: 0 good, 1 findings (one per line), 77 the proxy or openssl is not installed.
"""

import base64
import contextlib
import os
import pathlib
import re
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile

from haproxy_crowd import free_port, wait_for_port

DEPLOY = pathlib.Path(__file__).resolve().parents[2] / "deploy"
PROXIES = DEPLOY / "proxies"
TOKEN = "a-secret-of-more-than-sixteen-bytes"
LOGIN = {"Authorization": "Basic " + base64.b64encode(b"visitor:guest").decode()}
EXIT_SKIPPED = 77


def uncommented(text, *words):
    """The optional lines of a configuration that begin with one of these words, and what they hold."""
    return re.sub(rf"^(\s*)# ?((?:{'|'.join(words)}))", r"\1\2", text, flags=re.M)


def nginx_command(folder, port, server_port):
    text = uncommented((PROXIES / "nginx.conf").read_text(), "auth_basic")
    hashed = subprocess.run(["openssl", "passwd", "-apr1", "guest"], capture_output=True, text=True, check=True).stdout
    (folder / "catgs.htpasswd").write_text("visitor:" + hashed)
    text = text.replace("/etc/nginx/certs/chain.pem", f"{folder}/certificate").replace("/etc/nginx/certs/key.pem", f"{folder}/key")
    text = text.replace("/etc/nginx/", f"{folder}/").replace("listen 443", f"listen 127.0.0.1:{port}").replace(":8080", f":{server_port}")
    places = "".join(f"{kind}_temp_path {folder}/{kind};" for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
    config = folder / "all.conf"
    config.write_text(f"daemon off; pid {folder}/pid; error_log {folder}/log; events {{}} http {{ access_log off; {places} {text} }}")
    return ["nginx", "-c", str(config), "-e", str(folder / "log")]


def caddy_command(folder, port, server_port):
    text = uncommented((PROXIES / "Caddyfile").read_text(), "basicauth", r"\tvisitor", "}")
    hashed = subprocess.run(["caddy", "hash-password", "--plaintext", "guest"], capture_output=True, text=True, check=True).stdout
    text = text.replace("HASH_BY_caddy_hash-password", hashed.strip()).replace(":8080", f":{server_port}")
    text = text.replace("tours.example {", f"https://localhost:{port} {{\n\tbind 127.0.0.1\n\ttls {folder}/certificate {folder}/key")
    config = folder / "Caddyfile"
    config.write_text("{\n\tadmin off\n\tauto_https disable_redirects\n}\n" + text)
    return ["caddy", "run", "--config", str(config), "--adapter", "caddyfile"]


def haproxy_command(folder, port, server_port):
    text = re.sub(r"^frontend stats[\s\S]*|^ +(bind :80|server gpu2 .*)$", "", (DEPLOY / "haproxy/haproxy.cfg").read_text(), flags=re.M)
    (folder / "pem").write_text((folder / "certificate").read_text() + (folder / "key").read_text())
    text = text.replace("/etc/haproxy/certs/", f"{folder}/pem").replace("bind :443", f"bind 127.0.0.1:{port}")
    config = folder / "haproxy.cfg"
    text = text.replace("maxconn 20000", "maxconn 200").replace("10.0.0.11:8080", f"127.0.0.1:{server_port}")
    config.write_text(text)
    return ["haproxy", "-db", "-f", str(config)]


def ask(port, path, headers):
    """The status line of the answer, and what follows it."""
    request = f"GET {path} HTTP/1.1\r\nHost: localhost:{port}\r\n" + "".join(f"{name}: {value}\r\n" for name, value in headers.items())
    context = ssl._create_unverified_context()
    with socket.create_connection(("127.0.0.1", port), 10) as plain, context.wrap_socket(plain, server_hostname="localhost") as connection:
        connection.sendall(request.encode() + b"\r\n")
        answer = b""
        with contextlib.suppress(OSError):
            while b"\r\n\r\n" not in answer and (piece := connection.recv(4096)):
                answer += piece
    return answer.decode(errors="replace").partition("\r\n")


def findings_of(port, asks_for_login):
    websocket = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Protocol": "catgs.v1",
                 "Sec-WebSocket-Key": base64.b64encode(b"0123456789abcdef").decode(), "Origin": f"https://localhost:{port}"}
    cases = (
        ("the page without the proxy's login", "/", {}, 401 if asks_for_login else 200),
        ("the page", "/", LOGIN, 200),
        ("large cookies", "/", LOGIN | {"Cookie": "a=" + 12_000 * "c"}, 200),
        ("scenes without a token", "/api/scenes", LOGIN, 401),
        ("scenes with a token beside the login", "/api/scenes", LOGIN | {"Catgs-Token": TOKEN}, 200),
        ("a websocket", "/", LOGIN | websocket, 101),
        ("a websocket of another site's page", "/", LOGIN | websocket | {"Origin": "https://elsewhere.example"}, 403),
    )
    for what, path, headers, status in cases:
        line = ask(port, path, headers)[0]
        if f" {status} " not in line + " ":
            yield f"{what}: {line!r}, not {status}"


def main():
    name, server = sys.argv[1:]
    if not all(map(shutil.which, (name, "openssl"))):
        print(f"SKIPPED: {name} or openssl is not installed")
        return EXIT_SKIPPED
    with tempfile.TemporaryDirectory() as text, contextlib.ExitStack() as programs:
        folder = pathlib.Path(text)
        folder.chmod(0o755)  # nginx reads logins as another user
        os.environ |= {"XDG_DATA_HOME": text, "XDG_CONFIG_HOME": text}  # of Caddy
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "1", "-subj", "/CN=localhost",
                        "-keyout", folder / "key", "-out", folder / "certificate"], check=True, capture_output=True)
        (folder / "tokens").write_text(TOKEN + "\n")
        server_port, port = free_port(), free_port()
        command = [server, "--scene", "synth:city:1000", "--port", str(server_port), "--admin-bind", "off", "--renderer", "cpu",
                   "--token-file", str(folder / "tokens"), "--trusted-proxy", "127.0.0.1"]
        commands = {"nginx": nginx_command, "caddy": caddy_command, "haproxy": haproxy_command}
        proxy = commands[name](folder, port, server_port)
        with open(folder / "output", "wb") as output:
            try:
                for program, its_port in ((command, server_port), (proxy, port)):
                    process = programs.enter_context(subprocess.Popen(program, stdout=output, stderr=output))
                    programs.callback(process.terminate)
                    wait_for_port(its_port)  # HAProxy checks the server at once
                findings = list(findings_of(port, name != "haproxy"))
            except (OSError, RuntimeError) as error:
                findings = [str(error)]
        if findings:
            print("\n".join(findings), (folder / "output").read_text(errors="replace"), sep="\n")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
