#!/usr/bin/env bash
# CloudCompare's command line keeps the scales of a Gaussian .ply, and drops colour, opacity and
# rotation.
#
# Tool:   cloudcompare 2.11.3-7.1 (Debian 12).
# Guess:  Opening a .ply and saving it as .ply keeps its properties, or drops those that it does not
#         know, all alike.
# Seen:   Without its window it keeps the properties whose names begin with "scal", as scalar fields.
#         scale_0 is one of them and comes back as scalar_scale_0. f_dc_0, opacity and rot_0 are
#         gone. Named scal_f_dc_0, scal_opacity and scal_rot_0 they stay. No warning is printed.
# Output: x y z f_dc_0 opacity scale_0 rot_0
#         -> x y z scalar_scale_0
#         x y z scal_f_dc_0 scal_opacity scale_0 scal_rot_0
#         -> x y z scalar_scal_f_dc_0 scalar_scal_opacity scalar_scale_0 scalar_scal_rot_0
#
# Exits 0 if so, 1 if not. Needs Debian 12 on x86-64 and the network, and no root.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# The package and all that it needs, in a folder of their own: nothing is installed.
mkdir -p state/lists/partial cache/archives/partial root home
: > empty
export APT_CONFIG=$work/apt.conf
cat > apt.conf <<CONF
Dir::State "$work/state";
Dir::State::status "$work/empty";
Dir::Cache "$work/cache";
Debug::NoLocking "true";
APT::Sandbox::User "";
APT::Install-Recommends "false";
CONF
apt-get -qq update
apt-get -qq --yes --download-only install cloudcompare=2.11.3-7.1 >/dev/null
for package in cache/archives/*.deb; do
  dpkg-deb -x "$package" root
done
libraries=$(find root/lib root/usr/lib -name '*.so*' -not -path '*/gconv/*' -printf "$work/%h\n" \
  | sort -u | tr '\n' ':')

save_again() {
  env LD_LIBRARY_PATH="$libraries" QT_QPA_PLATFORM=offscreen HOME="$work/home" \
    QT_PLUGIN_PATH="$work/root/usr/lib/x86_64-linux-gnu/qt5/plugins" \
    root/usr/bin/CloudCompare -SILENT -C_EXPORT_FMT PLY -PLY_EXPORT_FMT ASCII -NO_TIMESTAMP \
    -O "$1" -SAVE_CLOUDS >log 2>&1
}
properties() { sed -n 's/^property [a-z]* //p' "$1" | tr '\n' ' ' | sed 's/ $//'; }

holds=0
try() {
  local wanted=$1 name
  shift
  {
    printf 'ply\nformat ascii 1.0\nelement vertex 2\n'
    for name in "$@"; do printf 'property float %s\n' "$name"; done
    printf 'end_header\n1 2 3 0.5 2 -3 1\n4 5 6 0.25 1 -4 1\n'
  } > cloud.ply
  properties cloud.ply
  echo
  save_again cloud.ply
  echo "-> $(properties cloud.ply)"
  [[ $(properties cloud.ply) == "$wanted" ]] || holds=1
  if grep -iE 'warning|ignored|dropped' log; then holds=1; fi
}
try 'x y z scalar_scale_0' x y z f_dc_0 opacity scale_0 rot_0
try 'x y z scalar_scal_f_dc_0 scalar_scal_opacity scalar_scale_0 scalar_scal_rot_0' \
  x y z scal_f_dc_0 scal_opacity scale_0 scal_rot_0
exit "$holds"
