#!/usr/bin/env bash
# usage: bundle_start.sh BUILD_DIR [debian | ubuntu]
# Packs BUILD_DIR by deploy/bundle.sh, unpacks it in a Debian 12 (or Ubuntu 24.04) that has nothing but its base system,
# in namespaces without a network, and starts it there: the page, /readyz, a picture. Its notices are looked at too.
# Needs root and debootstrap, otherwise it says so and exits 77.
set -euo pipefail
# shellcheck source=tests/deploy/containers.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/containers.sh"

readonly PORT=8174

# In the new namespaces.
inside() {
  local root=$1
  ip link set lo up
  mount -t proc proc "$root/proc"
  chroot "$root" /catgs/bin/catgs-server --version
  chroot "$root" /catgs/bin/catgs-render synth city --gaussians 20000 --seed 1 /city.ply >/dev/null
  chroot "$root" /catgs/bin/catgs-render frames /city.ply --script orbit --duration 1 --fps 2 --size 160x90 --out /frames >/dev/null
  local begin_ms
  begin_ms=$(now_ms)
  chroot "$root" /catgs/bin/catgs-server --scene /city.ply --port "$PORT" --admin-bind off >"$root/log" 2>&1 &
  local server=$!
  until "$source_dir/deploy/http_check.sh" "$PORT" /readyz 2>/dev/null; do
    kill -0 "$server" 2>/dev/null || die "$(cat "$root/log")"
    sleep 0.05
  done
  say "ready $(($(now_ms) - begin_ms)) ms after the start"
  "$source_dir/deploy/http_check.sh" "$PORT" / || die "no page"
  grep -E 'renderer|encoder' "$root/log"
  kill -TERM "$server"
  wait "$server" || die "it did not end as asked"
}

if [[ ${1:-} == --inside ]]; then
  inside "$2"
  exit
fi

build=$1
system=${2:-debian}
require_tools debootstrap xz unshare ip
require_namespaces
work=$(mktemp -d)
trap 'rm -rf --one-file-system "$work"' EXIT
"$source_dir/deploy/bundle.sh" --build "$build" --out "$work/bundle.tar.xz"
make_system "$system" "$work/root" "$cache/$system"
tar -C "$work/root" -xJf "$work/bundle.tar.xz"
notices=$work/root/catgs/share/doc
grep -q GPL "$notices/NOTICES.md" || die "no notices"
cmp "$source_dir/LICENSE" "$notices/LICENSE" || die "no licence of ours"
[[ -s $notices/licenses/libx264-164/copyright || -n $(find "$notices/licenses" -path '*x264*' -name copyright) ]] || die "no licence of libx264"
while read -r library; do
  [[ -f $library ]] || die "$library is missing"
done < <(find "$work/root/catgs/lib" -type f)
say "$(find "$notices/licenses" -mindepth 1 -maxdepth 1 | wc -l) licences, $(find "$work/root/catgs/lib" -type f | wc -l) libraries, $(du -h "$work/bundle.tar.xz" | cut -f1) packed, $(du -sh "$work/root/catgs" | cut -f1) unpacked"
unshare --mount --pid --net --fork --kill-child "$0" --inside "$work/root"
