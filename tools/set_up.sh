#!/bin/bash
# Installs grabberd and what it needs to run into a virtual environment, with its progress in a few lines instead of
# the hundred or two of pip's, which are kept in a file: bash tools/set_up.sh PYTHON LOG
set -euo pipefail
python=$1 log=$2
SECONDS=0

progress() {
    awk '
        function say(text) { print "  " text; fflush() }
        /^Collecting / { if (packages++ % 15 == 0) say("fetching package " packages " of about 45") }
        /^Building wheels?|Building editable/ { if (!built++) say("building grabberd itself, with its kernel in C") }
        /^Installing collected packages/ { say("unpacking " NF - 3 " packages, without a word for a while") }
    '
}

echo "Installing NumPy, OpenCV, SciPy, FastAPI, Matplotlib and what these need: about 45 packages, half a gigabyte."
echo "This takes one to three minutes, once, most of it the download. Details: $log"
if ! "$python" -m pip install --disable-pip-version-check --no-input --progress-bar off \
    --constraint constraints.txt --editable '.[report]' 2>&1 | tee "$log" | progress; then
    tail -n 15 "$log" >&2
    echo "*** The installation failed; above are the last lines of $log. make run tries again. ***" >&2
    exit 1
fi
echo "Installed in $SECONDS s."
