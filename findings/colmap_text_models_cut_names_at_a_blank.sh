#!/usr/bin/env bash
# COLMAP cannot read back the image names that it writes into a text model, if they have blanks.
#
# Tool:   colmap 3.8-1 (Debian 12), model_converter.
# Guess:  BIN to TXT to BIN gives the same model, or an error.
# Seen:   The .txt has the whole names. Reading it cuts each at its first blank, without a warning:
#         "room 1.png" and "room 2.png" are both "room" afterwards, and fit no picture. The status is
#         0, and poses are right.
# Output: binary      room 1.png, room 2.png
#         -> text     room 1.png, room 2.png
#         -> binary   room, room
#
# Exits 0 if so, 1 if not. Needs Debian 12 on x86-64 and the network, and no root.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# The package and all that it needs, in a folder of their own: nothing is installed.
mkdir -p state/lists/partial cache/archives/partial root first text second
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
apt-get -qq --yes --download-only install colmap=3.8-1 >/dev/null
for package in cache/archives/*.deb; do
  dpkg-deb -x "$package" root
done
libraries=$(find root/lib root/usr/lib -name '*.so*' -not -path '*/gconv/*' -printf "$work/%h\n" \
  | sort -u | tr '\n' ':')
convert() {
  env LD_LIBRARY_PATH="$libraries" QT_QPA_PLATFORM=offscreen HOME="$work" root/usr/bin/colmap \
    model_converter --input_path "$1" --output_path "$2" --output_type "$3" >log 2>&1
}

# One pinhole camera and two pictures without points. perl-base is a part of each Debian.
perl -e 'sub file { open F, ">:raw", "first/$_[0].bin"; print F $_[1]; close F }
  file("cameras", pack("Q< l< l< Q< Q< d<4", 1, 1, 1, 640, 480, 500, 500, 320, 240));
  my @images = map { pack("l< d<7 l< Z* Q<", $_, 1, 0, 0, 0, 0, 0, $_, 1, "room $_.png", 0) } 1, 2;
  file("images", pack("Q<", 2) . join "", @images);
  file("points3D", pack("Q<", 0))'
convert first text TXT
convert text second BIN

names() {
  perl -e 'local $/; open F, "<:raw", $ARGV[0]; my $bytes = <F>;
           my ($count, $at, @names) = (unpack("Q<", $bytes), 8);
           for (1 .. $count) {
             my ($name, $points) = unpack("Z* Q<", substr $bytes, $at + 64);
             push @names, $name; $at += 64 + length($name) + 1 + 8 + 24 * $points }
           print join ", ", @names' "$1/images.bin"
}
in_text=$(grep -o 'room.*' text/images.txt | sort | paste -sd ',' | sed 's/,/, /')
echo "binary      $(names first)"
echo "-> text     $in_text"
echo "-> binary   $(names second)"
[[ $(names first) == 'room 1.png, room 2.png' && $in_text == 'room 1.png, room 2.png' \
  && $(names second) == 'room, room' ]] && ! grep -qi warn log
