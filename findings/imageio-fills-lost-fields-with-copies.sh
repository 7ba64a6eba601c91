#!/usr/bin/env bash
# imageio: a video with lost fields comes back complete, its gaps filled with copies
#
# Expected: a recording that lost 20 of its 60 fields holds 40 pictures (Matroska stores a time for
#   each), and imageio gives 40, as PyAV and OpenCV do; both plugins of imageio agree with each
#   other.
# What happens: imread() with the FFMPEG plugin returns 60 pictures. The 20 additional ones are
#   copies of the last picture before the gap: a camera that kept running on an object that stood
#   still. With the pyav plugin the same call returns 40. OpenCV reads 40 and announces 60 as
#   CAP_PROP_FRAME_COUNT.
# Why: the FFMPEG plugin reads raw pictures from a pipe of the ffmpeg program. That output format is
#   not one of variable rate, so ffmpeg's default is constant rate: it duplicates pictures into the
#   gaps (and drops some where they come too dense). imageio-ffmpeg passes neither -fps_mode nor
#   -vsync.
# Why it matters: index times field period is the right time only for the filled version, and the
#   picture is a measurement only in the other one. A wall speed of exactly zero, then a jump of 20
#   fields' way, is what the copies yield. With PyAV one has the time stamps; use those.
# With: imageio 2.38.1, imageio-ffmpeg 0.8.1, av 18.1.0, opencv-python-headless 5.0.0.93. Not
#   found in the documentation.
# Output seen:
#   stored           40 pictures, fields 20 to 39 lost
#   imageio, FFMPEG  60 pictures, 20 equal to the one before; at 18..22: [18, 19, 19, 19, 19]
#   imageio, pyav    40 pictures, 0 equal to the one before; at 18..22: [18, 19, 40, 41, 42]
#   PyAV             40 pictures, 0 equal to the one before; at 18..22: [18, 19, 40, 41, 42]
#   OpenCV           40 pictures, 0 equal to the one before; at 18..22: [18, 19, 40, 41, 42]
#   OpenCV           announced 60
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    imageio==2.38.1 imageio-ffmpeg==0.8.1 av==18.1.0 opencv-python-headless==5.0.0.93 numpy==2.4.6

cat > "$work/show.py" <<'PY'
from fractions import Fraction

import av
import cv2
import imageio.v3 as iio
import numpy as np

arrived = [*range(20), *range(40, 60)]  # the numbers of the fields; each is a grey level too
with av.open("lost.mkv", "w") as file:
    stream = file.add_stream("ffv1", rate=50)
    stream.width, stream.height, stream.pix_fmt = 64, 48, "gray"
    stream.codec_context.time_base = Fraction(1, 50)
    for number in arrived:
        frame = av.VideoFrame.from_ndarray(np.full((48, 64), 2 * number, np.uint8), format="gray")
        frame.pts, frame.time_base = number, Fraction(1, 50)
        file.mux(stream.encode(frame))
    file.mux(stream.encode())


def report(name, levels):
    numbers = [int(level) // 2 for level in levels]
    repeated = sum(a == b for a, b in zip(numbers, numbers[1:]))
    print(f"{name:16} {len(numbers)} pictures, {repeated} equal to the one before; at 18..22: {numbers[18:23]}")


print(f"stored           {len(arrived)} pictures, fields 20 to 39 lost")
for plugin in ("FFMPEG", "pyav"):
    report(f"imageio, {plugin}", iio.imread("lost.mkv", plugin=plugin)[:, 0, 0, 0])
with av.open("lost.mkv") as file:
    report("PyAV", [frame.to_ndarray()[0, 0] for frame in file.decode(video=0)])
video = cv2.VideoCapture("lost.mkv")
announced = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
levels = []
while True:
    ok, picture = video.read()
    if not ok:
        break
    levels.append(picture[0, 0, 0])
report("OpenCV", levels)
print(f"OpenCV           announced {announced}")
PY

cat > "$work/expected" <<'TXT'
stored           40 pictures, fields 20 to 39 lost
imageio, FFMPEG  60 pictures, 20 equal to the one before; at 18..22: [18, 19, 19, 19, 19]
imageio, pyav    40 pictures, 0 equal to the one before; at 18..22: [18, 19, 40, 41, 42]
PyAV             40 pictures, 0 equal to the one before; at 18..22: [18, 19, 40, 41, 42]
OpenCV           40 pictures, 0 equal to the one before; at 18..22: [18, 19, 40, 41, 42]
OpenCV           announced 60
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
