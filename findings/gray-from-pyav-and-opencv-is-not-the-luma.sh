#!/usr/bin/env bash
# PyAV, OpenCV: the grey value of a frame is not its luma; 256 levels become 220
#
# Expected: to_ndarray(format="gray") of a yuv420p frame is its Y plane, and so is a channel of
#   OpenCV's picture when the chroma is neutral. FFV1 is lossless, so a recording that used all 256
#   levels has them again.
# What happens: Y is stretched from 16...235 to 0...255 and cut off at both ends. A ramp of 256
#   levels comes out with 220: everything below 16 is 0, everything above 235 is 255. PyAV and
#   OpenCV do not even agree: a Y of 100 is 98 in one and 97 in the other.
# Why: in FFmpeg a yuv format without a mark is of limited range, and gray is always of full range
#   (swscale treats it so), so a conversion between them rescales; through BGR, with other rounding.
#   The first rows of to_ndarray() without a format are the stored values.
# Why it matters: cheap grabbers deliver Y beyond 16...235 as it comes from the cable, and a
#   retroreflective target is just what lies above 235. Its profile is cut off flat, the threshold
#   means another level in each program, and the centroid loses its weights. Files of pixel format
#   gray are not concerned.
# With: av 18.1.0, opencv-python-headless 5.0.0.93, numpy 2.4.6.
# Output seen:
#   stored Y                          256 levels; Y of 10, 100, 200, 240 is 10 100 200 240
#   PyAV to_ndarray(format="gray")    220 levels; Y of 10, 100, 200, 240 is 0 98 214 255
#   OpenCV read()                     220 levels; Y of 10, 100, 200, 240 is 0 97 214 255
#   PyAV to_ndarray()[:height]        256 levels; Y of 10, 100, 200, 240 is 10 100 200 240
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    av==18.1.0 opencv-python-headless==5.0.0.93 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import av
import cv2
import numpy as np

ramp = np.tile(np.arange(256, dtype=np.uint8), (16, 1))
with av.open("ramp.mkv", "w") as file:
    stream = file.add_stream("ffv1", rate=50)
    stream.width, stream.height, stream.pix_fmt = 256, 16, "yuv420p"
    frame = av.VideoFrame.from_ndarray(np.vstack([ramp, np.full((8, 256), 128, np.uint8)]), format="yuv420p")
    frame.pts = 0
    file.mux(stream.encode(frame))
    file.mux(stream.encode())

with av.open("ramp.mkv") as file:
    frame = next(file.decode(video=0))
_, picture = cv2.VideoCapture("ramp.mkv").read()
for name, grey in (
    ("stored Y", ramp),
    ('PyAV to_ndarray(format="gray")', frame.to_ndarray(format="gray")),
    ("OpenCV read()", picture[..., 0]),
    ("PyAV to_ndarray()[:height]", frame.to_ndarray()[:16]),
):
    row = grey.reshape(-1, 256)[0]
    print(f"{name:32} {len(np.unique(row)):4} levels; Y of 10, 100, 200, 240 is", *row[[10, 100, 200, 240]])
PY

cat > "$work/expected" <<'TXT'
stored Y                          256 levels; Y of 10, 100, 200, 240 is 10 100 200 240
PyAV to_ndarray(format="gray")    220 levels; Y of 10, 100, 200, 240 is 0 98 214 255
OpenCV read()                     220 levels; Y of 10, 100, 200, 240 is 0 97 214 255
PyAV to_ndarray()[:height]        256 levels; Y of 10, 100, 200, 240 is 10 100 200 240
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
