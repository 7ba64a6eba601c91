#!/usr/bin/env bash
# SciPy: a double matrix from MATLAB loads as uint8, and differences wrap at 256
#
# Expected: x and y are of class double in MATLAB, so loadmat() gives float64 arrays and x - y is
#   what MATLAB would say.
# What happens: the values happen to be whole numbers below 256, and loadmat() gives uint8. x - y of
#   10 and 20 is 246; x + 10 of 250 is 4. The same script is right for the next file, in which one
#   value has a fraction (float64), and for one with a value of 300 (uint16, which wraps elsewhere).
# Why: MATLAB and Octave store a double matrix of whole numbers in the smallest integer type that
#   holds them (the format calls it data compression); the class in the header still says double.
#   loadmat() returns the stored type by default. mat_dtype=True returns the class of MATLAB;
#   pymatreader has no such option.
# Why it matters: what is whole by nature is just what is subtracted: field numbers, counters, pixel
#   positions, times in ms, thresholds. Short captures are hit and long ones not, so the test data
#   differs from the real.
# With: scipy 1.17.1, numpy 2.4.6, pymatreader 1.3.2. The docstring of loadmat names mat_dtype and
#   its default; what it means for arithmetic it does not say. The file below is laid out by hand as
#   MATLAB's -v6 does it.
# Output seen:
#   loadmat: x uint8, y uint8, z uint16, w float64
#     x - y: [246, 100, 255], x + 10: [20, 210, 4]
#   loadmat, mat_dtype=True: x float64, y float64, z float64, w float64
#     x - y: [-10.0, 100.0, -1.0], x + 10: [20.0, 210.0, 260.0]
#   pymatreader: x uint8, y uint8, z uint16, w float64
#     x - y: [246, 100, 255], x + 10: [20, 210, 4]
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    scipy==1.17.1 numpy==2.4.6 pymatreader==1.3.2

cat > "$work/show.py" <<'PY'
import struct

import pymatreader
from scipy.io import loadmat

UINT8, INT8, INT32, UINT32, UINT16, DOUBLE, MATRIX = 2, 1, 5, 6, 4, 9, 14
CLASS_DOUBLE = 6


def element(kind, content):
    return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def double_matrix(name, values, stored_as, code):
    """A 1 x n matrix of class double, its values stored in the type given."""
    body = element(UINT32, struct.pack("<II", CLASS_DOUBLE, 0))
    body += element(INT32, struct.pack("<ii", 1, len(values)))
    body += element(INT8, name.encode())
    body += element(stored_as, struct.pack(f"<{len(values)}{code}", *values))
    return struct.pack("<II", MATRIX, len(body)) + body


with open("capture.mat", "wb") as file:
    file.write(b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM")
    file.write(double_matrix("x", [10, 200, 250], UINT8, "B"))
    file.write(double_matrix("y", [20, 100, 251], UINT8, "B"))
    file.write(double_matrix("z", [10, 200, 300], UINT16, "H"))
    file.write(double_matrix("w", [10.5, 200, 250], DOUBLE, "d"))

read = {
    "loadmat": loadmat("capture.mat"),
    "loadmat, mat_dtype=True": loadmat("capture.mat", mat_dtype=True),
    "pymatreader": pymatreader.read_mat("capture.mat"),
}
for name, data in read.items():
    types = ", ".join(f"{v} {data[v].dtype}" for v in "xyzw")
    print(f"{name}: {types}")
    print(f"  x - y: {(data['x'] - data['y']).ravel().tolist()}, x + 10: {(data['x'] + 10).ravel().tolist()}")
PY

cat > "$work/expected" <<'TXT'
loadmat: x uint8, y uint8, z uint16, w float64
  x - y: [246, 100, 255], x + 10: [20, 210, 4]
loadmat, mat_dtype=True: x float64, y float64, z float64, w float64
  x - y: [-10.0, 100.0, -1.0], x + 10: [20.0, 210.0, 260.0]
pymatreader: x uint8, y uint8, z uint16, w float64
  x - y: [246, 100, 255], x + 10: [20, 210, 4]
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
