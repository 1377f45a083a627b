#!/usr/bin/env bash
# PCL writes coordinates of 8 bytes into a text .pcd with 8 digits.
#
# Tool:   pcl-tools 1.13.0+dfsg-3 (Debian 12), pcl_ply2pcd -format 0.
# Guess:  A .pcd whose header says "SIZE 8 8 8" and "TYPE F F F" holds what a double holds: 15 to 17
#         digits in text.
# Seen:   It holds 8. At a northing of 5,412,345 a step is 0.1 units, so that points of survey
#         coordinates move by up to 0.05. The binary form keeps them.
# Output: SIZE 8 8 8
#         wrote 5412345.3456, text reads 5412345.3, binary reads 5412345.3456
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
apt-get -qq --yes --download-only install pcl-tools=1.13.0+dfsg-3 >/dev/null
for package in cache/archives/*.deb; do
  dpkg-deb -x "$package" root
done
libraries=$(find root/lib root/usr/lib -name '*.so*' -not -path '*/gconv/*' -printf "$work/%h\n" \
  | sort -u | tr '\n' ':')

# perl-base is a part of each Debian.
perl -e 'binmode STDOUT;
         print "ply\nformat binary_little_endian 1.0\nelement vertex 1\n";
         print "property double $_\n" for qw(x y z);
         print "end_header\n", pack("d<3", 500123.4567, 5412345.3456, 431.2345)' > in.ply
for format in 0 1; do
  env LD_LIBRARY_PATH="$libraries" root/usr/bin/pcl_ply2pcd -format "$format" in.ply "$format.pcd" \
    >/dev/null 2>&1
done
size=$(grep '^SIZE' 0.pcd)
text=$(tail -n 1 0.pcd | cut -d ' ' -f 2)
binary=$(perl -e 'local $/; open F, "<:raw", $ARGV[0]; $_ = <F>; /DATA binary\n/g;
                  printf "%.4f", unpack "d<", substr $_, pos() + 8, 8' 1.pcd)
echo "$size"
echo "wrote 5412345.3456, text reads $text, binary reads $binary"
[[ $size == 'SIZE 8 8 8' && $text == 5412345.3 && $binary == 5412345.3456 ]]
