#!/usr/bin/env bash
# C3D: a point's residual becomes its camera mask between the two Python libraries
#
# Expected: the residual (how well the rays of a point meet) and the mask of the cameras that saw it
#   come back as they were written, whichever of ezc3d and c3d wrote the file and whichever reads
#   it.
# What happens: each library is at peace with itself, and each sees the other's two values in each
#   other's place. A point with residual 5 seen by cameras 1 and 2 (mask 3), written by ezc3d, has
#   for c3d a residual of 3 and a mask of 5 (cameras 1 and 3). Since a mask has seven bits, a
#   residual of 200 arrives as 72. And ezc3d itself keeps residuals as one byte: fractions are cut
#   off, 300 comes back as 44.
# Why: in a C3D file of floating point data the two share one number, which stands for a 16-bit word
#   of two bytes. ezc3d 1.7 puts the mask into the low byte and the residual into the high one; c3d
#   takes the low byte for the residual and bits 8 to 14 for the mask (Reader.read_frames: last_word
#   & 0x00ff, (last_word & 0x7f00) >> 8). "First byte" and "high byte" are easily confused in the
#   format's manual.
# Why it matters: the residual is the only measure of quality that C3D carries for a point. After
#   the swap it is a small, plausible number that says nothing, and points are kept or thrown away
#   by it. Check one file with both libraries before trusting either, and export what is known of a
#   point's accuracy beside the C3D file.
# With: ezc3d 1.7.2, c3d 0.6.0. Related: pyomeca/ezc3d issue 386 (residuals of floating point
#   files).
# Output seen:
#   (residual, mask)        [(5.0, 3), (2.7, 3), (200.0, 3), (300.0, 3)]
#   ezc3d wrote, ezc3d read [(5.0, 3), (2.0, 3), (200.0, 3), (44.0, 3)]
#   ezc3d wrote, c3d read   [(3.0, 5), (3.0, 2), (3.0, 72), (3.0, 44)]
#   c3d wrote, c3d read     [(5.0, 3)]
#   c3d wrote, ezc3d read   [(3.0, 5)]
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    ezc3d==1.7.2 c3d==0.6.0 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import warnings

import c3d
import ezc3d
import numpy as np

warnings.simplefilter("ignore")  # c3d: "No analog data found in file"


def with_ezc3d():
    read = ezc3d.c3d("points.c3d")["data"]["meta_points"]
    masks = [int(sum(1 << k for k in range(7) if column[k])) for column in read["camera_masks"][:, 0].T]
    return list(zip(map(float, read["residuals"].ravel()), masks))


def with_c3d():
    with open("points.c3d", "rb") as file:
        return [(float(points[0, 3]), int(points[0, 4])) for _, points, _ in c3d.Reader(file).read_frames()]


residuals = [5.0, 2.7, 200.0, 300.0]
mask = 0b0000011  # cameras 1 and 2

file = ezc3d.c3d()
file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
file["parameters"]["POINT"]["LABELS"]["value"] = ("t1",)
file["data"]["points"] = np.ones((4, 1, len(residuals)))
file["data"]["meta_points"]["residuals"] = np.array(residuals).reshape(1, 1, -1)
seen = np.zeros((7, 1, len(residuals)), bool)
seen[:2] = True
file["data"]["meta_points"]["camera_masks"] = seen
file.write("points.c3d")
print("(residual, mask)       ", [(r, mask) for r in residuals])
print("ezc3d wrote, ezc3d read", with_ezc3d())
print("ezc3d wrote, c3d read  ", with_c3d())

writer = c3d.Writer(point_rate=50.0)
writer.set_point_labels(["t1"])
no_analog = np.zeros((0, 0), np.float32)
writer.add_frames([(np.array([[1, 1, 1, 5, mask]], np.float32), no_analog)])
with open("points.c3d", "wb") as file:
    writer.write(file)
print("c3d wrote, c3d read    ", with_c3d())
print("c3d wrote, ezc3d read  ", with_ezc3d())
PY

cat > "$work/expected" <<'TXT'
(residual, mask)        [(5.0, 3), (2.7, 3), (200.0, 3), (300.0, 3)]
ezc3d wrote, ezc3d read [(5.0, 3), (2.0, 3), (200.0, 3), (44.0, 3)]
ezc3d wrote, c3d read   [(3.0, 5), (3.0, 2), (3.0, 72), (3.0, 44)]
c3d wrote, c3d read     [(5.0, 3)]
c3d wrote, ezc3d read   [(3.0, 5)]
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
