#!/usr/bin/env bash
# pyxdf: a second of lost samples is spread evenly over the whole recording
#
# Expected: load_xdf() removes the jitter of a regular stream but respects its gaps. The thresholds
#   for a break are one second and 500 samples, so a gap of 1.02 s starts a new segment.
# What happens: in a stream of 50 Hz with 50 samples missing after the fifth second, there is no
#   break. One straight line is fitted through all time stamps: the first sample moves by 0.29 s to
#   before the start, those next to the gap by more than half a second, the gap shrinks to a step of
#   23 ms. The only hints are the effective rate of 42.9 Hz and a line in the log.
# Why: a step counts as a break only when it is longer than max(1 s, 500 samples), not either of the
#   two (_detect_breaks in pyxdf.py). At the 500 Hz and more of an EEG the two agree. At 50 Hz, 500
#   samples are 10 s, and any shorter gap is taken for jitter.
# Why it matters: this format exists to lay streams of different devices over each other. Half a
#   second is half a cycle of what is measured here: pressure and movement come out in opposite
#   phase, by an error that depends on where in the recording the gap was. Pass
#   dejitter_timestamps=False, or jitter_break_threshold_samples=0 together with a threshold in
#   seconds that suits the stream.
# With: pyxdf 1.17.5, numpy 2.4.6. The docstring says "if also ... is crossed", which is the
#   maximum.
# Output seen:
#   time stamp of sample             0     249     250     449   largest step   largest error
#   default                     -0.295   5.505   5.528  10.164        0.023 s         0.525 s
#   dejitter_timestamps=False    0.000   4.980   6.000   9.980        1.020 s         0.000 s
#   threshold_samples=0          0.000   4.980   6.000   9.980        1.020 s         0.000 s
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    pyxdf==1.17.5 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import logging
import struct

import numpy as np
import pyxdf

logging.disable(logging.CRITICAL)


def length(n):
    return b"\x04" + struct.pack("<I", n)


def chunk(tag, content):
    return length(len(content) + 2) + struct.pack("<H", tag) + content


stream = struct.pack("<I", 1)
header = (
    "<?xml version='1.0'?><info><name>wall</name><type>Mocap</type><channel_count>1</channel_count>"
    "<nominal_srate>50</nominal_srate><channel_format>double64</channel_format></info>"
)
footer = "<?xml version='1.0'?><info></info>"
number = np.r_[0:250, 300:500]  # 50 samples, one second, did not arrive
truth = number * 0.02
samples = b"".join(b"\x08" + struct.pack("<dd", t, x) for t, x in zip(truth, np.sin(2 * np.pi * truth)))
with open("wall.xdf", "wb") as file:
    file.write(b"XDF:" + chunk(1, b"<?xml version='1.0'?><info><version>1.0</version></info>"))
    file.write(chunk(2, stream + header.encode()))
    file.write(chunk(3, stream + length(len(number)) + samples))
    file.write(chunk(6, stream + footer.encode()))

print("time stamp of sample             0     249     250     449   largest step   largest error")
for name, options in (
    ("default", {}),
    ("dejitter_timestamps=False", {"dejitter_timestamps": False}),
    ("threshold_samples=0", {"jitter_break_threshold_samples": 0}),
):
    streams, _ = pyxdf.load_xdf("wall.xdf", **options)
    t = streams[0]["time_stamps"]
    values = "".join(f"{v + 0.0:8.3f}" for v in np.round(t[[0, 249, 250, 449]], 3))
    print(f"{name:26.26}{values}{np.diff(t).max():13.3f} s{np.abs(t - truth).max():14.3f} s")
PY

cat > "$work/expected" <<'TXT'
time stamp of sample             0     249     250     449   largest step   largest error
default                     -0.295   5.505   5.528  10.164        0.023 s         0.525 s
dejitter_timestamps=False    0.000   4.980   6.000   9.980        1.020 s         0.000 s
threshold_samples=0          0.000   4.980   6.000   9.980        1.020 s         0.000 s
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
