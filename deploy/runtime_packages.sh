#!/usr/bin/env bash
# usage: runtime_packages.sh PROGRAM...
# Prints the Debian packages of the shared libraries that the programs load, one per line. A machine
# needs these to run the programs, but not to build them.
set -euo pipefail

for program in "$@"; do
  absent=$(ldd "$program" | grep 'not found' || true)
  [[ -z $absent ]] || {
    printf '%s lacks libraries here:\n%s\n' "$program" "$absent" >&2
    exit 1
  }
  ldd "$program" | awk '$2 == "=>" && $3 ~ /^\// { print $3 }'
done | sort -u | while read -r library; do
  # Packages name their files by the path before /lib became a link to /usr/lib, or after.
  # It complains of those that it does not know.
  real=$(readlink -f -- "$library")
  package=$({ dpkg-query -S "$library" "$real" "${real#/usr}" 2>/dev/null || true; } | sed -n '1s/[:,].*//p')
  [[ -n $package ]] || {
    echo "$library belongs to no package" >&2
    exit 1
  }
  printf '%s\n' "$package"
done | sort -u
