#!/usr/bin/env bash
# Open3D's tensor writer shuffles the properties of a .ply.
#
# Tool:   python3-open3d 0.16.1+ds-2+b4 (Debian 12).
# Guess:  Reading a .ply and writing it keeps the order of its properties, or sorts them by name. A
#         reader with a fixed layout of a 3DGS .ply, as many viewers have, then still works.
# Seen:   Positions and normals come first, and all others in the order of a hash table: rot_2
#         before rot_0, f_dc_1 behind opacity. Names and values are right.
# Output: read    x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 ...
#         written x y z nx ny nz followed by the other 11 in another order, not that of names
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
apt-get -qq --yes --download-only install python3-open3d=0.16.1+ds-2+b4 >/dev/null
for package in cache/archives/*.deb; do
  dpkg-deb -x "$package" root
done
libraries=$(find root/lib root/usr/lib -name '*.so*' -not -path '*/gconv/*' -not -path '*/python3*/*' \
  -printf "$work/%h\n" | sort -u | tr '\n' ':')

cat > try.py <<'PY'
import sys
import numpy
import open3d

names = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
         "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
rows = numpy.arange(3 * len(names), dtype="<f4").reshape(3, len(names))
with open("in.ply", "wb") as file:
    file.write(("ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
                + "".join(f"property float {name}\n" for name in names) + "end_header\n").encode())
    file.write(rows.tobytes())
open3d.t.io.write_point_cloud("out.ply", open3d.t.io.read_point_cloud("in.ply"))

data = open("out.ply", "rb").read()
end = data.index(b"end_header\n") + len(b"end_header\n")
written = [line.split()[2] for line in data[:end].decode().split("\n") if line.startswith("property")]
values = numpy.frombuffer(data[end:], "<f4").reshape(3, len(written))
print("read    " + " ".join(names))
print("written " + " ".join(written))
same_values = all((values[:, written.index(name)] == rows[:, i]).all() for i, name in enumerate(names))
others = written[6:]
holds = (same_values and written[:6] == names[:6] and others != names[6:] and others != sorted(others))
sys.exit(0 if holds else 1)
PY
env LD_LIBRARY_PATH="$libraries" PYTHONHOME="$work/root/usr" HOME="$work" \
  PYTHONPATH="$work/root/usr/lib/python3/dist-packages" root/usr/bin/python3 try.py
