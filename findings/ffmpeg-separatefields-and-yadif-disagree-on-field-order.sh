#!/usr/bin/env bash
# FFmpeg: on the same recording, separatefields and yadif put the two fields into opposite order
#
# Expected: two filters of one program that turn 25 frames into 50 fields agree about which field of
#   a frame is the older. Where the stream does not say, both take the documented default of yadif,
#   top field first, which is right for PAL.
# What happens: for frames that are not marked as interlaced, yadif, bwdif, w3fdif and estdif begin
#   with the top field, separatefields with the bottom one. Its fields then come in the order 1 0 3
#   2 5 4: two steps forward, one back, fifty times a second. When the stream says tff or bff, all
#   of them agree.
# Why: yadif and its kin look at the "interlaced" flag first and assume top field first without it
#   (parity=auto). separatefields looks only at the "top field first" flag (vf_separatefields.c);
#   not set is taken for bottom field first. A frame of unknown order has neither flag.
# Why it matters: grabbers deliver interlaced pictures as plain frames, and most recorders (OpenCV,
#   PyAV, rawvideo, FFV1 from a pipe) do not set the flags unless told to. A wall that moves
#   smoothly looks fine in any single field; only its speed alternates in sign, and a low-pass
#   filter then hides that. Put setfield=tff before separatefields, always.
# With: FFmpeg 9.0.2 (of imageio-ffmpeg 0.8.1). The manual gives yadif's default; of separatefields
#   it says that it uses the frame's field dominance and that setfield helps when it is wrong.
# Output seen:
#   marked as     filter            the first fields that come out
#   prog          separatefields   1 0 3 2 5 4 7 6
#   prog          yadif=1          0 1 2 3 4 5 6 7
#   prog          bwdif=1          0 1 2 3 4 5 6 7
#   tff           separatefields   0 1 2 3 4 5 6 7
#   tff           yadif=1          0 1 2 3 4 5 6 7
#   tff           bwdif=1          0 1 2 3 4 5 6 7
#   bff           separatefields   1 0 3 2 5 4 7 6
#   bff           yadif=1          1 0 3 2 5 4 7 6
#   bff           bwdif=1          1 0 3 2 5 4 7 6
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    imageio-ffmpeg==0.8.1 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import subprocess

import imageio_ffmpeg
import numpy as np

WIDTH, HEIGHT = 64, 48


def ffmpeg(*arguments, data=b""):
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", *arguments]
    return subprocess.run(command, input=data, stdout=subprocess.PIPE, check=True).stdout


# Six frames as a PAL grabber gives them: the top rows of frame k are field 2k, the bottom rows 2k + 1.
frames = np.zeros((6, HEIGHT, WIDTH), np.uint8)
for k, frame in enumerate(frames):
    frame[0::2] = 100 + 10 * (2 * k)
    frame[1::2] = 100 + 10 * (2 * k + 1)
source = ("-f", "rawvideo", "-pix_fmt", "gray", "-s", f"{WIDTH}x{HEIGHT}", "-r", "25", "-i", "-")

print("marked as     filter            the first fields that come out")
for mark in ("prog", "tff", "bff"):
    ffmpeg(*source, "-vf", f"setfield={mark}", "-c:v", "ffv1", "-y", f"{mark}.mkv", data=frames.tobytes())
    for name, rows in (("separatefields", HEIGHT // 2), ("yadif=1", HEIGHT), ("bwdif=1", HEIGHT)):
        raw = ffmpeg("-i", f"{mark}.mkv", "-vf", name, "-pix_fmt", "gray", "-f", "rawvideo", "-")
        fields = np.frombuffer(raw, np.uint8).reshape(-1, rows, WIDTH)
        numbers = [(int(np.median(field)) - 100) // 10 for field in fields[:8]]
        print(f"{mark:13} {name:16}", *numbers)
PY

cat > "$work/expected" <<'TXT'
marked as     filter            the first fields that come out
prog          separatefields   1 0 3 2 5 4 7 6
prog          yadif=1          0 1 2 3 4 5 6 7
prog          bwdif=1          0 1 2 3 4 5 6 7
tff           separatefields   0 1 2 3 4 5 6 7
tff           yadif=1          0 1 2 3 4 5 6 7
tff           bwdif=1          0 1 2 3 4 5 6 7
bff           separatefields   1 0 3 2 5 4 7 6
bff           yadif=1          1 0 3 2 5 4 7 6
bff           bwdif=1          1 0 3 2 5 4 7 6
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
