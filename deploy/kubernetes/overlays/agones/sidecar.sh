#!/usr/bin/env bash
# Speaks to Agones for catgs-server, which knows nothing of it: Ready once the server is, Health as
# long as it answers, and Shutdown when an allocated server has had visitors and has none left.
#
# Addresses come from the environment: CATGS_ADMIN_PORT (9090), AGONES_SDK_HTTP_PORT (9358);
# CATGS_EMPTY_S: for so long nobody is there before the server is given back (120).
set -euo pipefail

admin_port=${CATGS_ADMIN_PORT:-9090}
sdk_port=${AGONES_SDK_HTTP_PORT:-9358}
empty_s=${CATGS_EMPTY_S:-120}

# http PORT METHOD PATH: the body of an answer of 200, within four seconds.
http() {
  local connection answer
  exec {connection}<>"/dev/tcp/127.0.0.1/$1" || return 1
  printf '%s %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n{}' \
    "$2" "$3" >&"$connection"
  answer=$(timeout 4 cat <&"$connection") || true
  exec {connection}>&-
  [[ $answer == "HTTP/1.1 200"* ]] && printf '%s' "$answer"
}

sessions() { http "$admin_port" GET /metrics | sed -n 's/^catgs_sessions \([0-9]*\).*/\1/p'; }

until http "$admin_port" GET /readyz >/dev/null 2>&1; do sleep 1; done
until http "$sdk_port" POST /ready >/dev/null 2>&1; do sleep 1; done

visited=0 empty_since=$SECONDS
while sleep 2; do
  # A server that hangs sends no Health, and Agones replaces it.
  http "$admin_port" GET /healthz >/dev/null 2>&1 || continue
  http "$sdk_port" POST /health >/dev/null 2>&1 || true
  present=$(sessions 2>/dev/null) || continue
  if ((${present:-0} > 0)); then
    visited=1
    empty_since=$SECONDS
  elif ((visited && SECONDS - empty_since >= empty_s)); then
    http "$sdk_port" POST /shutdown >/dev/null 2>&1 && exit 0
  fi
done
