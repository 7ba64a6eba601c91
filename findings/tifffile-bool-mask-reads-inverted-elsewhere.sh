#!/usr/bin/env bash
# tifffile: a boolean mask written with imwrite() is its own negative in OpenCV and Pillow
#
# Expected: imwrite("mask.tif", mask) of a bool array makes a one-bit picture in which True is white,
#   as Pillow makes it from the same array, and every reader returns the 24 set pixels of 128.
# What happens: the file is tagged MINISWHITE (0 is white) while the bits stay as they are. tifffile
#   reads it back without looking at that tag and finds 24 set pixels; OpenCV and Pillow obey the tag
#   and find the other 104. Pillow's own file, tagged MINISBLACK, is 24 for all three.
#   For uint8 it goes the other way round with files tagged MINISWHITE: tifffile gives the stored
#   values, the other two invert them. And at 16 bits nobody inverts any more.
# Why: with no `photometric` argument, the writer takes MINISWHITE as soon as the dtype is bool
#   ("if bilevel: photometric = MINISWHITE" in TiffWriter.write); it stores the array as it is. That
#   reading applies no photometric conversion is in the docstring of TiffPage.asarray.
# Why it matters: one-bit fields, target masks and regions of interest travel as TIFF. A round trip
#   through one library looks perfect; the next program measures the background. The centroid of a
#   centred target does not even move. Always pass photometric="minisblack".
# With: tifffile 2026.3.3, opencv-python-headless 5.0.0.93, pillow 13.0.0.
# Output seen:
#   set pixels of 128                 tag          tifffile  OpenCV  Pillow
#   tifffile, bool                    MINISWHITE         24     104     104
#   tifffile, bool, minisblack        MINISBLACK         24      24      24
#   Pillow, bool                      MINISBLACK         24      24      24
#   tifffile, uint8, miniswhite       MINISWHITE         24     104     104
#   tifffile, uint16, miniswhite      MINISWHITE         24      24      24
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    tifffile==2026.3.3 opencv-python-headless==5.0.0.93 pillow==13.0.0 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import cv2
import numpy as np
import tifffile
from PIL import Image

mask = np.zeros((8, 16), bool)
mask[:, :3] = True


def show(name):
    with tifffile.TiffFile("m.tif") as file:
        tag = file.pages[0].photometric.name
    counts = (
        np.count_nonzero(tifffile.imread("m.tif")),
        np.count_nonzero(cv2.imread("m.tif", cv2.IMREAD_UNCHANGED)),
        np.count_nonzero(np.asarray(Image.open("m.tif"))),
    )
    print(f"{name:34}{tag:12}{counts[0]:9}{counts[1]:8}{counts[2]:8}")


print("set pixels of 128                 tag          tifffile  OpenCV  Pillow")
tifffile.imwrite("m.tif", mask)
show("tifffile, bool")
tifffile.imwrite("m.tif", mask, photometric="minisblack")
show("tifffile, bool, minisblack")
Image.fromarray(mask).save("m.tif")
show("Pillow, bool")
for dtype, white in (("uint8", 255), ("uint16", 65535)):
    tifffile.imwrite("m.tif", mask.astype(dtype) * np.array(white, dtype), photometric="miniswhite")
    show(f"tifffile, {dtype}, miniswhite")
PY

cat > "$work/expected" <<'TXT'
set pixels of 128                 tag          tifffile  OpenCV  Pillow
tifffile, bool                    MINISWHITE         24     104     104
tifffile, bool, minisblack        MINISBLACK         24      24      24
Pillow, bool                      MINISBLACK         24      24      24
tifffile, uint8, miniswhite       MINISWHITE         24     104     104
tifffile, uint16, miniswhite      MINISWHITE         24      24      24
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
