#!/usr/bin/env bash
# Installs a wheel into an empty environment away from the checkout, and runs one capture there, so that a
# forgotten file or dependency shows; then the same program from a source archive, with a compiler and without.
# usage: install_and_capture.sh PYTHON WHEEL [SOURCE_ARCHIVE]
set -euo pipefail
python=$1 wheel=$(realpath "$2") source=${3:+$(realpath "$3")}
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
from grabberd.instrument.acquisition import LOGGERS
assert {"csv", "fake", "iio", "mqtt", "serial"} <= set(LOGGERS.available()), "a driver has been forgotten"
assert json.load(open("logger.json"))["readings"] > 100, "the simulated logger says too little"
'
"$work/venv/bin/grabberd" export liner.grab --format csv --out exported
points=$(($(wc -l <exported/points.csv) - 1))
test "$points" -gt 3000 || { echo "wheel: only $points points in 64 fields"; exit 1; }
"$work/venv/bin/python" -c '
from grabberd.server.web import Files, render
edition = Files().newest()
assert "js/main.js" in edition.files and "symbols.svg" in edition.files, "the page has been forgotten"
assert edition.version in render(edition, "en", {})
from grabberd_liner.reports.environment import environment
for name in ("calibration", "analysis"):
    environment().get_template(f"{name}.html.jinja")
'
complete() { # the site and the examples are in it
    "$work/venv/bin/python" -c '
import grabberd
from grabberd.server.web.page import Site
assert Site().is_built, "the documentation has been forgotten"
assert Site().find("tutorials/first_look.ipynb"), "the notebooks have been forgotten"
for name in ("frame.grab", "liner.grab", "object.grab"):
    with grabberd.open(grabberd.example(name)) as capture:
        assert capture.rate_hz == 50.0
'
}
complete
version() { "$work/venv/bin/grabberd" --version; }
expect() { # WORDS
    local said
    # Whole, and then looked at: a command whose reader has seen enough fails.
    said=$(version)
    [[ $said == *"$1"* ]] || { echo "wheel: --version does not say '$1': $said"; exit 1; }
}
case $wheel in *abi3*) expect "(compiled kernel)" ;; esac
echo "wheel: installed into an empty environment, 64 fields gave $points points"

[ -n "$source" ] || exit 0
# Once as it is, once where no compiler is found: PATH has the environment's own programs alone.
install_source() { env "$@" "$work/venv/bin/python" -m pip install --quiet --no-compile --no-deps --force-reinstall "$source"; }
install_source GRABBERD_KERNEL=must
complete
expect "(compiled kernel)"
"$work/venv/bin/grabberd" capture --fields 8 --out compiled.grab >/dev/null
compiled=$(version)
install_source -u CC PATH="$work/venv/bin"
complete
expect "(numpy, no compiled kernel)"
"$work/venv/bin/grabberd" capture --fields 8 --out plain.grab >/dev/null
echo "wheel: from the source archive with a compiler: $compiled; without:"
version
