#!/usr/bin/env bash
# FFmpeg, OpenCV: the same cut of a video has 50 frames more in MKV than in MP4, and another time
#   zero
#
# Expected: "-ss 1 -c copy" into MP4, MKV or MPEG-TS copies the same packets, so all three hold the
#   same frames; what OpenCV announces as CAP_PROP_FRAME_COUNT is what it delivers.
# What happens: all three hold the 152 packets from the last key frame on, 50 of them before the
#   cut. In MP4 an edit list hides these: OpenCV and PyAV deliver 102 frames, the first one is the
#   one asked for, and the count still says 152. MKV and TS have nothing like it: 152 frames, which
#   start one second before the cut. Frame k of one file is frame k + 50 of the other, and "0 ms" is
#   another moment.
# Why: a copy can only start at a key frame. The MP4 muxer writes the negative time stamps of the
#   frames before the cut as an edit list; the demuxer then marks their packets as to be decoded and
#   thrown away (AV_PKT_FLAG_DISCARD). CAP_PROP_FRAME_COUNT is the number of packets in the index.
#   For the other containers the stamps are shifted until they start at zero.
# Why it matters: people cut a long recording to the cycle they need, then locate things by frame
#   number. Points measured in the MKV and a vacuum trace aligned with the MP4 are one second apart,
#   a whole pulsation, which does not show in the curves. Cut by decoding to FFV1, or start at a key
#   frame.
# With: FFmpeg 9.0.2 (of imageio-ffmpeg 0.8.1), opencv-python-headless 5.0.0.93, av 18.1.0. The
#   ffmpeg manual says of -ss with -c copy that the part before the cut is kept; not that containers
#   differ in hiding it.
# Output seen:
#   file      packets   announced   OpenCV   PyAV   first frame   its time
#   cut.mp4       152         152      102    102            50       0 ms
#   cut.mkv       152         152      152    152             0       0 ms
#   cut.ts        152         152      152    152             0       0 ms
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
    imageio-ffmpeg==0.8.1 opencv-python-headless==5.0.0.93 av==18.1.0 numpy==2.4.6

cat > "$work/show.py" <<'PY'
import subprocess

import av
import cv2
import imageio_ffmpeg


def ffmpeg(*arguments):
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", *arguments], check=True)


# Four seconds at 50 Hz, a key frame every two; the grey level of a frame is its number plus 16.
picture = ("-f", "lavfi", "-i", "color=black:s=64x48:r=50:d=4", "-vf", "geq=lum='16+N':cb=128:cr=128")
ffmpeg(*picture, "-c:v", "libx264", "-g", "100", "-crf", "1", "-pix_fmt", "yuv420p", "whole.mp4")

print("file      packets   announced   OpenCV   PyAV   first frame   its time")
for name in ("cut.mp4", "cut.mkv", "cut.ts"):
    ffmpeg("-ss", "1", "-i", "whole.mp4", "-t", "2", "-c", "copy", name)
    with av.open(name) as file:
        packets = sum(packet.size > 0 for packet in file.demux(video=0))
    with av.open(name) as file:
        levels = [int(frame.to_ndarray()[0, 0]) for frame in file.decode(video=0)]
    video = cv2.VideoCapture(name)
    announced = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    read = 0
    while video.read()[0]:
        read += 1
        if read == 1:
            time_ms = video.get(cv2.CAP_PROP_POS_MSEC)
    print(f"{name:8}{packets:9}{announced:12}{read:9}{len(levels):7}{levels[0] - 16:14}{time_ms:8.0f} ms")
PY

cat > "$work/expected" <<'TXT'
file      packets   announced   OpenCV   PyAV   first frame   its time
cut.mp4       152         152      102    102            50       0 ms
cut.mkv       152         152      152    152             0       0 ms
cut.ts        152         152      152    152             0       0 ms
TXT

cd "$work"
venv/bin/python show.py | tee seen
if ! diff -u expected seen; then
    echo "The behaviour has changed." >&2
    exit 1
fi
echo "As stated."
