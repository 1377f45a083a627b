#!/usr/bin/env bash
# Writes the fixed camera paths of the demo city into FOLDER: make_paths.sh CATGS_RENDER FOLDER
# README.md says what each path shows. TheFixedPathsOfTheCityAreFitAndStay fails if a version moves them.
set -euo pipefail

render=$(realpath "$1")
mkdir -p "$2"
cd "$2"
work=$(mktemp -d)
trap 'rm -r "$work"' EXIT

cat > "$work/oblique_keys.tum" <<END
0 -10 -22 -40 -0.3043 -0.1651 -0.0537 0.9366
2.5 2 -22 -34 -0.3090 0.0000 0.0000 0.9511
5 14 -22 -40 -0.3043 0.1651 0.0537 0.9366
END
cat > "$work/street_keys.tum" <<END
0 0.5 -1.7 -34 0.0000 -0.0698 0.0000 0.9976
2.5 0.5 -1.7 -30.5 0.0000 0.0698 0.0000 0.9976
5 0.5 -1.7 -27 0.0000 -0.0698 0.0000 0.9976
END

path() {  # path NAME KIND FLAG... makes NAME.tum by `trace KIND`
  "$render" trace "$2" "$work/city.ply" "${@:3}" --duration 5 --out "$1.tum"
}

"$render" synth city --gaussians 300000 --seed 1 "$work/city.ply"
path head script --script head
path walk script --script walk
path orbit orbit --speed 20
path pan pan --speed 2 --reach 5
path zoom zoom --speed 2 --reach 5
path rotate rotate --speed 30
path oblique script --script "tour:$work/oblique_keys.tum"
path street script --script "tour:$work/street_keys.tum"
