#!/usr/bin/env bash
# usage: http_check.sh PORT PATH [HOST]
# Exits with 0 if http://HOST:PORT/PATH answers 200: a health check for images without curl.
set -euo pipefail

host=${3:-127.0.0.1}
exec {server}<>"/dev/tcp/$host/$1"
printf 'GET %s HTTP/1.1\r\nHost: %s\r\nConnection: close\r\n\r\n' "$2" "$host" >&"$server"
read -r -t 3 status <&"$server"
[[ $status == "HTTP/1.1 200"* ]]
