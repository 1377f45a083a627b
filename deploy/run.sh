#!/usr/bin/env bash
# Builds the server and serves scenes to a browser: see usage below.
# shellcheck source-path=SCRIPTDIR disable=SC2317  # `step` calls functions by name
set -euo pipefail
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

usage() {
  cat <<'USAGE'
usage: deploy/run.sh [SCENE...] [options] [catgs-server options]

Installs what the build needs, builds the server and the browser client, and serves the scenes.
Without a SCENE it makes a procedural city of 300,000 Gaussians and a garden, and serves these with tours.
SCENE is a .ply, .splat, .ksplat, .spz, .sog, .ssog, .glb, .gltf, .lcc, .lcc2 or .tree file, or a folder: SOG,
streamed SOG, 3D Tiles, or a training output. Or it is synth:KIND:COUNT, such as synth:city:20000.

  --port N     listen on port N (default 8080)
  --lan        also serve other devices in this network: all interfaces, a token, TLS with a
               self-signed certificate, and a QR code of the link for your phone
  --no-cuda    build for the CPU even if there are a GPU and nvcc
  --with-load  also build catgs-load, which measures how many visitors a machine can serve
  --log FILE   the build's full log (default build/run/run.log)
  -h, --help   this text

Every other option goes to catgs-server, with the word behind it as its value:
  deploy/run.sh --encoder jpeg garden.ply --fps 30
build/run/bin/catgs-server --help lists them. Repeat an option that takes several values.

Exit status: 0 stopped with Ctrl-C, 1 a step failed, 2 wrong usage, 3 packages are missing and
installing them needs root, 4 not Debian 12 or Ubuntu 24.04, 5 the port is in use.
USAGE
}

readonly build_dir=$SOURCE_DIR/build/run
readonly bin_dir=$build_dir/bin
scenes=()
server_options=()
port=8080
lan=0
allow_cuda=1
with_load=OFF
log=$build_dir/run.log
readonly demo_dir=$build_dir/scenes
readonly demo_scenes=("$demo_dir/city.ply" "$demo_dir/garden.ply")

parse_arguments() {
  while (($# > 0)); do
    case $1 in
      --port | --log)
        (($# > 1)) || fail "$EXIT_USAGE" "$1 needs a value. See --help."
        if [[ $1 == --port ]]; then port=$2; else log=$2; fi
        shift
        ;;
      --port=*) port=${1#*=} ;;
      --log=*) log=${1#*=} ;;
      --lan) lan=1 ;;
      --no-cuda) allow_cuda=0 ;;
      --with-load) with_load=ON ;;
      -h | --help)
        usage
        exit 0
        ;;
      --open | --admin-open) server_options+=("$1") ;;  # the server's only ones without a value
      -*=*) server_options+=("$1") ;;
      -*)
        server_options+=("$1")
        if (($# > 1)) && [[ $2 != -* || $2 == -[0-9]* ]]; then
          server_options+=("$2")
          shift
        fi
        ;;
      *)
        if [[ $1 == synth:* ]]; then
          scenes+=("$1")
        else
          [[ -e $1 ]] || fail "$EXIT_USAGE" "No such scene: $1"
          scenes+=("$(realpath -- "$1")")
        fi
        ;;
    esac
    shift
  done
  if [[ " ${server_options[*]} " =~ " --log-level"[=\ ](warn|error) ]]; then
    fail "$EXIT_USAGE" "--log-level: run.sh reads the server's start lines, which are of level info." \
      "For a quieter log start $bin_dir/catgs-server yourself."
  fi
  if [[ ! $port =~ ^[1-9][0-9]{0,4}$ ]] || ((port > 65535)); then
    fail "$EXIT_USAGE" "--port $port: a port is a number from 1 to 65535."
  fi
}

# Prints the inode of the socket that listens on the port, whatever its address; nothing if free.
listening_inode() {
  local hex
  hex=$(printf ':%04X' "$1")
  # State 0A is LISTEN; field 2 is address:port, field 10 the inode.
  # Without IPv6 there is no tcp6, and that is no failure.
  { cat /proc/net/tcp /proc/net/tcp6 2>/dev/null || true; } |
    awk -v port="$hex" \
      '!found && $4 == "0A" && substr($2, length($2) - 4) == port { print $10; found = 1 }'
}

check_port() {
  local inode owner="another user's program (run as root to see which)" fd pid
  inode=$(listening_inode "$port")
  [[ -n $inode ]] || return 0
  fd=$(find /proc/[0-9]*/fd -maxdepth 1 -lname "socket:\[$inode\]" -print -quit 2>/dev/null || true)
  if [[ -n $fd ]]; then
    pid=${fd#/proc/}
    pid=${pid%%/*}
    owner="$(<"/proc/$pid/comm") (process $pid)"
  fi
  fail "$EXIT_PORT_BUSY" "Port $port is in use by: $owner" \
    "Stop that program, or choose another port: ./deploy/run.sh --port $((port % 65535 + 1))"
}

check_system() {
  printf 'distribution: %s\ncores: %s\nCUDA: %s (%s)\n' "$distribution" "$(nproc)" \
    "$cuda_choice" "$cuda_note"
  df -h "$SOURCE_DIR"
  grep -E "^Mem(Total|Available):" /proc/meminfo
}

# Scenes come with sidecars of their own, which have no tours. A tour that an author has changed stays.
make_demo_scenes() {
  local made=$demo_dir/made
  mkdir -p "$made"
  "$bin_dir/catgs-render" synth garden --gaussians 150000 --seed 1 "$made/garden.ply"
  "$bin_dir/catgs-render" synth city --gaussians 300000 --seed 1 "$made/city.ply"
  mv "$made"/*.ply "$demo_dir"
  rm -r "$made"
  cp -ru "$SOURCE_DIR"/deploy/demo/{city,garden}.* "$demo_dir"
}

ensure_scene() {
  if ((${#scenes[@]} > 0)); then
    step_done "Scene: ${scenes[*]##*/}"
    return
  fi
  # Like make: a newer generator may draw another city.
  if [[ ${demo_scenes[0]} -nt $bin_dir/catgs-render && ${demo_scenes[0]} -nt $SOURCE_DIR/deploy/demo/city.json ]]; then
    step_done "Demo scenes: city, 300,000 Gaussians, and garden, already made"
  else
    step "Make the demo scenes: city, 300,000 Gaussians, and garden" make_demo_scenes
  fi
}

# An author may have moved the start, or said how long a unit is.
has_walkable_area() { [[ ${1%.ply}.walk -nt $1 && ${1%.ply}.walk -nt ${1%.ply}.json ]]; }

# The server takes these files. Else it would look for the area when the first visitor asks.
find_walkable_areas() {
  local scene
  for scene in "${demo_scenes[@]}"; do
    has_walkable_area "$scene" || "$bin_dir/catgs-render" floors "$scene" "${scene%.ply}.walk" ||
      echo "$scene is shown, but nobody walks in it"
  done
}

ensure_walkable_areas() {
  ((${#scenes[@]} == 0)) || return 0
  if has_walkable_area "${demo_scenes[0]}" && has_walkable_area "${demo_scenes[1]}"; then
    step_done "Where people walk in the demo scenes: already found"
  else
    step "Find where people walk in the demo scenes" find_walkable_areas
  fi
}

# ---- --lan: a certificate for this machine's addresses, a token, and the link as a QR code ------

readonly lan_dir=$build_dir/lan
lan_address=""

choose_lan_address() {
  # The source address of the default route is the one that phones in the same network see.
  lan_address=$(ip -4 route get 192.0.2.1 2>/dev/null | sed -n 's/.* src \([0-9.]*\).*/\1/p')
  [[ -n $lan_address ]] || lan_address=$(hostname -I | awk '{ print $1 }')
  [[ -n $lan_address ]] ||
    fail "$EXIT_FAILED" "--lan: this machine has no network address. Connect it, or leave --lan out."
}

# Kept while the addresses stay: the browser's exception and the phone's link survive a restart.
make_lan_credentials() {
  local names address
  names="DNS:$(hostname),DNS:localhost,IP:127.0.0.1"
  for address in $(hostname -I); do
    names+=",IP:$address"
  done
  umask 077
  mkdir -p "$lan_dir"
  [[ -s $lan_dir/token ]] || openssl rand -hex 16 >"$lan_dir/token"
  if [[ -f $lan_dir/names && $(<"$lan_dir/names") == "$names" ]] &&
    openssl x509 -in "$lan_dir/cert.pem" -noout -checkend 86400; then
    return
  fi
  # 397 days: the longest life that phones accept of a server certificate.
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 397 \
    -keyout "$lan_dir/key.pem" -out "$lan_dir/cert.pem" -subj "/CN=CaT-GS on $(hostname)" \
    -addext "subjectAltName=$names" -addext extendedKeyUsage=serverAuth
  printf '%s' "$names" >"$lan_dir/names"
}

# ---- serving ----------------------------------------------------------------------------------

readonly admin_port=9090  # the server's default, and Prometheus' own
server_command=()
server_log=""
metrics_note=""

compose_server_command() {
  local served=("${scenes[@]}")
  ((${#served[@]} > 0)) || served=("${demo_scenes[@]}")
  server_log=$build_dir/server-$port.log  # one each: several may serve from here
  server_command=("$bin_dir/catgs-server" --scene "${served[@]}" --port "$port"
    --log-level info)
  if ((lan)); then
    server_command+=(--bind 0.0.0.0 --token-file "$lan_dir/token"
      --tls-cert "$lan_dir/cert.pem" --tls-key "$lan_dir/key.pem")
  fi
  # Metrics are an extra here: a taken admin port must not keep the pictures away.
  if [[ " ${server_options[*]}" != *" --admin-bind"* ]]; then
    if ((port == admin_port)); then
      metrics_note="off: port $admin_port serves the page (--admin-bind ADDRESS:PORT moves them)"
    elif [[ -n $(listening_inode "$admin_port") ]]; then
      metrics_note="off: port $admin_port is busy (--admin-bind ADDRESS:PORT moves them)"
    fi
    [[ -z $metrics_note ]] || server_command+=(--admin-bind off)
  fi
  server_command+=("${server_options[@]}")
}

# A wrong value of an option is reported before scenes are made and loaded.
check_server_options() {
  local message status=0
  # In front: behind an option that lacks its value it would be taken for that.
  message=$("${server_command[0]}" --print-config "${server_command[@]:1}" 2>&1 >/dev/null) || status=$?
  ((status == 0)) || fail "$status" "$message" "All options: $bin_dir/catgs-server --help"
}

start_server() {
  : >"$server_log"
  start_group "$server_log" "${server_command[@]}"
}

# The server's last words before it serves, in either log format, whatever address and TLS it was given.
readonly serving_pattern='s#.*open \(https\{0,1\}://[^ ]*\) in a browser.*#\1#p'

wait_until_serving() {
  local server=$1 ended=0
  until [[ -n $(sed -n "$serving_pattern" "$server_log") ]]; do
    if ((ended)); then
      # Its error and not the progress before it; a crash leaves only that.
      grep -E '^catgs-server: |"event":"start_failed"' "$server_log" || cat "$server_log"
      return 1
    fi
    # Its last words may have come since the log was read: one more look.
    kill -0 "$server" 2>/dev/null || ended=1
    sleep 0.1
  done
}

# server_says KEY: what the server's log gives as "KEY: text", the last time it did.
server_says() { sed -n "s/.*$1: \([^\"]*\).*/\1/p" "$server_log" | tail -n 1; }

# The ids of the scenes, as the server's log tells in either format.
scene_ids() {
  sed -n 's/.*\( info \|"message":"\)scene \(.*\): [0-9]* Gaussians, .*/\2/p' "$server_log"
}

# The same, ready for an address.
encoded_scene_ids() {
  scene_ids |
    sed 's/%/%25/g; s/ /%20/g; s/#/%23/g; s/&/%26/g; s/+/%2B/g; s/\\/%5C/g; s/\[/%5B/g; s/\]/%5D/g; s/"/%22/g; s/</%3C/g; s/>/%3E/g'
}

# row NAME TEXT...: one line of the welcome for each text, named once.
row() {
  local name=$1 text
  shift
  for text in "$@"; do
    printf '  %-9s %s\n' "$name" "$text"
    name=""
  done
}

# link_command PAGE: what prints a link to the first scene, or where the words of such links are.
link_command() {
  local tokens
  tokens=$(server_says "visitors need a TOKEN in the address")
  if [[ $tokens != "catgs-server token --token-key-file "* ]]; then
    printf 'TOKEN is %s' "$tokens"
    return
  fi
  tokens=${tokens#catgs-server token --token-key-file }
  printf '%q ' "$bin_dir/catgs-server" token --token-key-file "${tokens% makes one}" --address "$1" \
    --scene "$(scene_ids | head -n 1)"
}

print_welcome() {
  local url
  url=$(sed -n "$serving_pattern" "$server_log")
  if ((lan)); then
    url="https://$lan_address:$port/#token=$(<"$lan_dir/token")"
    qrencode -t ANSIUTF8 -m 2 "$url"
    echo "Your phone warns once about the certificate, which this machine made for itself."
  fi
  local -a ids scene_urls=() hints=("drag to turn, wheel or pinch to zoom, M to fly with W A S D")
  mapfile -t ids < <(encoded_scene_ids)
  local id page=${url%%#*}
  for id in "${ids[@]}"; do
    scene_urls+=("$page?scene=$id${url#"$page"}")
  done
  local metrics
  metrics=${metrics_note:-$(server_says metrics)}
  ((${#scenes[@]} > 0)) || hints+=("./deploy/run.sh your_scene.ply      serve a scene of your own")
  ((lan)) || hints+=("./deploy/run.sh --lan               open it on your phone")
  echo
  row open "$url"
  ((${#scene_urls[@]} < 2)) || row scenes "${scene_urls[@]}"
  [[ $url != *'#token=TOKEN' ]] || row link "$(link_command "$page")"
  row renderer "$(server_says renderer)"
  row encoder "$(server_says encoder)"
  row metrics "${metrics:-off}"
  row log "$server_log"
  row stop "Ctrl-C"
  echo
  row Try "${hints[@]}"
  if [[ -n $gpu_name && $cuda_choice == OFF ]] && ((allow_cuda)); then
    echo "  Your $gpu_name needs nvcc: install the CUDA toolkit"
    echo "  (https://developer.nvidia.com/cuda-downloads) and start again."
  fi
}

# stop_serving SIGNAL: the server tells open pages and ends, after Ctrl-C within two seconds, after
# SIGTERM when they have had the time of --drain-wait and --drain-deadline to go elsewhere.
stop_serving() {
  trap - INT TERM HUP
  printf '\nStopping: telling open pages.\n'
  stop_groups "$1"
  printf 'Stopped.\n'
  exit 0
}

main() {
  parse_arguments "$@"
  detect_distribution
  check_port
  if ((allow_cuda)); then
    choose_cuda
  else
    cuda_note="--no-cuda was given"
  fi
  if ((lan)); then
    build_packages+=("${lan_packages[@]}")
  fi
  lock_build run
  steps_begin $((6 + lan + (${#scenes[@]} == 0))) "$log"
  step "System: $distribution, $(nproc) cores, $cuda_note" check_system
  ensure_packages "${build_packages[@]}"
  local -a build_options=("-DCATGS_CUDA=$cuda_choice" "-DCATGS_LOAD=$with_load")
  if [[ $cuda_choice == ON ]]; then
    build_options+=("-DCMAKE_CUDA_COMPILER=$nvcc_path" -DCMAKE_CUDA_ARCHITECTURES=native)
  fi
  configure_build run "${build_options[@]}"
  build_all run "Build server, tools and client"
  compose_server_command
  check_server_options
  ensure_scene
  ensure_walkable_areas
  if ((lan)); then
    choose_lan_address
    step "Certificate and token for $lan_address" make_lan_credentials
  fi
  unlock_build
  start_server
  local server=${groups[-1]}
  step "Start the server" wait_until_serving "$server"
  trap 'stop_serving INT' INT
  trap 'stop_serving TERM' TERM HUP
  print_welcome
  local status=0
  wait "$server" || status=$?
  fail "$EXIT_FAILED" "The server ended by itself (status $status). The end of $server_log:" \
    "$(tail -n 10 "$server_log")"
}

main "$@"
