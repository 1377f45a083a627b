#!/usr/bin/env bash
# With tune zerolatency, x264 cuts each picture into as many slices as it has threads. So the same
# command makes other streams on other machines.
#
# Tools:  ffmpeg 5.1 and libx264 164 (Debian 12).
# Guess:  The number of threads changes how long encoding takes, and not the stream. A picture has
#         one slice unless --slices asks for more.
# Seen:   1, 2 and 4 threads make 1, 2 and 4 slices a picture, and different bytes. Without the tune
#         all three make one slice a picture. "-threads 0", the default, takes the number of cores.
# Output: zerolatency, 1 thread: 10 pictures of 1 slice
#         zerolatency, 2 threads: 10 pictures of 2 slices
#         zerolatency, 4 threads: 10 pictures of 4 slices
#         no tune, 4 threads: 10 pictures of 1 slice
#
# Exits 0 if so, 1 if not. Needs Debian 12 on x86-64 and the network, and no root.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# The package and all that it needs, in a folder of their own: nothing is installed.
mkdir -p state/lists/partial cache/archives/partial root
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
apt-get -qq --yes --download-only install 'ffmpeg=7:5.1.*' >/dev/null
for package in cache/archives/*.deb; do
  dpkg-deb -x "$package" root
done
libraries=$(find root/lib root/usr/lib -name '*.so*' -not -path '*/gconv/*' -printf "$work/%h\n" \
  | sort -u | tr '\n' ':')

# Coded slices are NAL units of type 1 and 5. perl-base is a part of each Debian.
slices() {
  perl -e 'local $/; open F, "<:raw", $ARGV[0]; $_ = <F>; my $n = 0;
           while (/\x00\x00\x01(.)/gs) { my $type = ord($1) & 31; ++$n if $type == 1 || $type == 5 }
           print $n' "$1"
}
holds=0
try() {
  local wanted=$1 label=$2 count
  shift 2
  env LD_LIBRARY_PATH="$libraries" root/usr/bin/ffmpeg -nostdin -v error -y -f lavfi \
    -i testsrc2=size=640x384:rate=30 -frames:v 10 -pix_fmt yuv420p -c:v libx264 -preset veryfast \
    "$@" -f h264 out.h264
  count=$(slices out.h264)
  echo "$label: 10 pictures of $((count / 10)) slice$([[ $count == 10 ]] || echo s)"
  [[ $count == $((10 * wanted)) ]] || holds=1
}
try 1 'zerolatency, 1 thread' -tune zerolatency -threads 1
try 2 'zerolatency, 2 threads' -tune zerolatency -threads 2
try 4 'zerolatency, 4 threads' -tune zerolatency -threads 4
try 1 'no tune, 4 threads' -threads 4
exit "$holds"
