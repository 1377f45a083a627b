#!/usr/bin/env bash
# Packs the programs and their shared libraries into one archive, for a machine that has neither
# these libraries nor a way to install them (a GPU node, say).
#
#   deploy/bundle.sh [--build DIR] [--out FILE.tar.xz]
#
# DIR is a finished build (default: build/run, else build/release, else build/cuda). FILE is
# build/catgs-bundle.tar.xz by default. The archive holds:
#
#   bin/               the programs: start them here
#   lib/               their libraries, most of which come with libavcodec: it is linked against
#                      every codec of the distribution
#   share/catgs/web    the web client, if it was built
#   share/catgs/load   scenarios of catgs-load, to size a deployment, if run.sh --with-load built it
#   share/doc          licences of all that is in it: read NOTICES.md there before you pass the
#                      archive on
#
# The other machine needs the same processor family, libstdc++, and a glibc at least as new. For
# CUDA it needs its own driver.
set -euo pipefail
# shellcheck source=deploy/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

usage() { sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "${BASH_SOURCE[0]}"; }

build='' out=''
while (($#)); do
  case $1 in
    --build | --out)
      (($# >= 2)) || fail "$EXIT_USAGE" "$1 needs a value." "See deploy/bundle.sh --help."
      if [[ $1 == --build ]]; then build=$2; else out=$2; fi
      shift 2
      ;;
    -h | --help)
      usage
      exit 0
      ;;
    *) fail "$EXIT_USAGE" "Unknown argument: $1" "See deploy/bundle.sh --help." ;;
  esac
done

if [[ -z $build ]]; then
  for candidate in run release cuda; do
    [[ -x $SOURCE_DIR/build/$candidate/bin/catgs-server ]] && build=$SOURCE_DIR/build/$candidate && break
  done
fi
[[ -n $build && -x $build/bin/catgs-server ]] ||
  fail "$EXIT_USAGE" "No finished build${build:+ in $build}." "Run deploy/run.sh first, or name a build folder with --build."
: "${out:=$SOURCE_DIR/build/catgs-bundle.tar.xz}"

stage=$(mktemp -d)
trap 'rm -rf -- "$stage" "$out.part"' EXIT
root=$stage/catgs
mkdir -p "$root/bin" "$root/lib" "$root/libexec"

for program in catgs-server catgs-render catgs-load; do
  [[ -x $build/bin/$program ]] || continue
  install -s "$build/bin/$program" "$root/libexec/$program"
  absent=$(ldd "$build/bin/$program" | grep 'not found' || true)
  [[ -z $absent ]] || fail "$EXIT_FAILED" "$program already lacks libraries on this machine:" "$absent"
  # The C and C++ run-time libraries stay the other machine's: they belong to its loader and driver.
  while read -r library; do
    cp -Lu -- "$library" "$root/lib/"
  done < <(ldd "$build/bin/$program" |
    awk '$2 == "=>" && $3 ~ /^\// && $1 !~ /^(libc|libm|libdl|librt|libpthread|libstdc\+\+|libgcc_s)\.so/ {print $3}')
  cat >"$root/bin/$program" <<'WRAPPER'
#!/bin/sh
home=$(dirname -- "$(dirname -- "$(readlink -f -- "$0")")")
LD_LIBRARY_PATH=$home/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} exec "$home/libexec/$(basename -- "$0")" "$@"
WRAPPER
  chmod +x "$root/bin/$program"
done
# What the libraries' licences ask for: their texts, and the versions whose sources belong to them.
mkdir -p "$root/share/doc/licenses"
cp -- "$SOURCE_DIR"/{LICENSE,deploy/NOTICES.md} "$root/share/doc/"
while read -r package; do
  dpkg-query -W -f '${Package} ${Version} (source: ${source:Package} ${source:Version})\n' "$package" | head -n 1 >>"$root/share/doc/PACKAGES"
  mkdir "$root/share/doc/licenses/$package"
  cp -L -- "/usr/share/doc/$package/copyright" "$root/share/doc/licenses/$package/"
done < <("$SOURCE_DIR/deploy/runtime_packages.sh" "$build"/bin/*)
if [[ -x $root/bin/catgs-load ]]; then
  mkdir -p "$root/share/catgs/load"
  cp -r -- "$SOURCE_DIR"/tests/load/{README.md,GLASS.md,alternate.py,scenarios} "$root/share/catgs/load/"
fi
if [[ -f $build/web_client/dist/index.html ]]; then
  mkdir -p "$root/share/catgs"  # where the server looks, seen from its program
  cp -r -- "$build/web_client/dist" "$root/share/catgs/web"
fi

printf 'Packing %s with its %d libraries, %s in all: a minute or two\n' "$build" \
  "$(find "$root/lib" -type f | wc -l)" "$(du -sh -- "$root" | cut -f1)"
# Level 2: 57 MB of 175, and a third less processor time than level 3 takes for 56.
XZ_OPT=${XZ_OPT:--T0 -2} tar -C "$stage" -cJf "$out.part" catgs
mv -- "$out.part" "$out"
printf '%s: %s\n' "$out" "$(du -h -- "$out" | cut -f1)"
printf 'On the other machine: tar -xJf %s && catgs/bin/catgs-server --scene SCENE\n' "$(basename -- "$out")"
