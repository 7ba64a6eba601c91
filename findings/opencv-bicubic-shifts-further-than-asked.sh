#!/usr/bin/env bash
# OpenCV: bicubic warping moves a disc 1.4 times as far as asked, linear in steps of 1/32 px until 4.x
#
# Expected: warpAffine() by 0.1 px moves the centroid of a smooth disc by 0.1 px; INTER_CUBIC and
#   INTER_LANCZOS4 do it more exactly than INTER_LINEAR, and OpenCV 5 as OpenCV 4.
# What happens: INTER_CUBIC moves it by 0.136 px, which is the worst of the three. In 4.13 all of them
#   move in steps of 1/32 px: a shift of 0.01 px gives back the same float32 picture bit for bit. In 5.0
#   linear and cubic follow the position, Lanczos still goes in steps. Linear in 5.0 and a cubic spline
#   (scipy.ndimage.shift) are right to four digits.
# Why: OpenCV's cubic kernel has the parameter a = -0.75 (interpolateCubic in imgwarp.cpp), and only
#   a = -0.5 reproduces a straight ramp; at small shifts a ramp moves by 1.5 times the shift. Version 4
#   takes the weights from a table of 32 positions (INTER_BITS = 5), also for float pictures. Since an
#   upgrade changes the linear result, numbers of a repeated study change too.
# Why it matters: targets are located to some hundredths of a pixel. Taking the lens distortion out with
#   remap() and "the better interpolation" adds an error as large as that, periodic in the position, so
#   it looks like a residual of the lens. The same holds for testing a locator with shifted pictures.
#   Transform coordinates rather than pictures; where it must be pictures, use linear in 5 or a spline.
# With: opencv-python-headless 4.13.0.92 and 5.0.0.93, scipy 1.17.1. The steps are opencv/opencv issues
#   25937 and 26361; the documentation of warpAffine() and remap() mentions neither these nor a.
# Output seen:
#   asked for, px       0.010   0.020   0.030   0.050   0.100
#   spline, SciPy      0.0100  0.0200  0.0300  0.0500  0.1000
#   4.13.0 LINEAR      0.0000  0.0312  0.0312  0.0625  0.0937
#   4.13.0 CUBIC       0.0000  0.0454  0.0454  0.0881  0.1283
#   4.13.0 LANCZOS4    0.0000  0.0350  0.0350  0.0694  0.1034
#   5.0.0  LINEAR      0.0100  0.0200  0.0300  0.0500  0.1000
#   5.0.0  CUBIC       0.0149  0.0294  0.0437  0.0714  0.1360
#   5.0.0  LANCZOS4    0.0000  0.0350  0.0350  0.0694  0.1034
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat > "$work/show.py" <<'PY'
import cv2
import numpy as np
from scipy import ndimage

shifts = (0.01, 0.02, 0.03, 0.05, 0.10)
y, x = np.mgrid[:64, :64].astype(float)
disc = (255 / (1 + np.exp((np.hypot(x - 32, y - 32) - 6) * 2))).astype(np.float32)


def centroid(picture):
    return float((picture.astype(float) * x).sum() / picture.astype(float).sum())


def show(name, shift_picture):
    moved = [centroid(shift_picture(s)) - centroid(disc) for s in shifts]
    print(f"{name:17}", *(f"{m + 0.0:7.4f}" for m in np.round(moved, 4)))


if cv2.__version__.startswith("4"):
    print(f"{'asked for, px':17}", *(f"{s:7.3f}" for s in shifts))
    show("spline, SciPy", lambda s: ndimage.shift(disc.astype(float), (0, s)))
for name in ("LINEAR", "CUBIC", "LANCZOS4"):
    flag = getattr(cv2, f"INTER_{name}")
    show(f"{cv2.__version__:6} {name}", lambda s: cv2.warpAffine(disc, np.float64([[1, 0, s], [0, 1, 0]]), (64, 64), flags=flag))
PY

cat > "$work/expected" <<'TXT'
asked for, px       0.010   0.020   0.030   0.050   0.100
spline, SciPy      0.0100  0.0200  0.0300  0.0500  0.1000
4.13.0 LINEAR      0.0000  0.0312  0.0312  0.0625  0.0937
4.13.0 CUBIC       0.0000  0.0454  0.0454  0.0881  0.1283
4.13.0 LANCZOS4    0.0000  0.0350  0.0350  0.0694  0.1034
5.0.0  LINEAR      0.0100  0.0200  0.0300  0.0500  0.1000
5.0.0  CUBIC       0.0149  0.0294  0.0437  0.0714  0.1360
5.0.0  LANCZOS4    0.0000  0.0350  0.0350  0.0694  0.1034
TXT

cd "$work"
for version in 4.13.0.92 5.0.0.93; do
    python3 -m venv "venv-$version"
    "venv-$version/bin/pip" install --quiet --disable-pip-version-check \
        "opencv-python-headless==$version" scipy==1.17.1 numpy==2.4.6
    "venv-$version/bin/python" show.py
done | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
