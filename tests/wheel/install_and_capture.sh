#!/usr/bin/env bash
# Installs a wheel into an empty environment away from the checkout, and runs one capture there, so that a
# forgotten file or dependency shows.   usage: install_and_capture.sh PYTHON WHEEL
set -euo pipefail
python=$1 wheel=$(realpath "$2")
here=$(pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$python" -m venv "$work/venv"
# One capture imports a small part of the packages: compiling all of them takes longer than the rest of this.
"$work/venv/bin/python" -m pip install --quiet --no-compile --constraint "$here/constraints.txt" "$wheel"
cd "$work"
unset PYTHONPATH
"$work/venv/bin/grabberd" capture --fields 64 --out liner.grab
"$work/venv/bin/grabberd" logger fake: --seconds 1 --json >logger.json
"$work/venv/bin/python" -c '
import json
from grabberd.acquisition import LOGGERS
assert {"csv", "fake", "iio", "mqtt", "serial"} <= set(LOGGERS.available()), "a driver has been forgotten"
assert json.load(open("logger.json"))["readings"] > 100, "the simulated logger says too little"
'
"$work/venv/bin/grabberd" export liner.grab --format csv --out exported
points=$(($(wc -l <exported/points.csv) - 1))
test "$points" -gt 3000 || { echo "wheel: only $points points in 64 fields"; exit 1; }
"$work/venv/bin/python" -c '
from grabberd.web import Files, render
edition = Files().edition
assert "js/main.js" in edition.files and "symbols.svg" in edition.files, "the page has been forgotten"
assert edition.version in render(edition, "en", {})
from grabberd.reports.environment import environment
for name in ("calibration", "analysis"):
    environment().get_template(f"{name}.html.jinja")
'
echo "wheel: installed into an empty environment, 64 fields gave $points points"
