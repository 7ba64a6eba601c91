#!/usr/bin/env bash
# FFmpeg: uncompressed P010, P016, NV16 and NV24 go into NUT without a word and come out as rgb555le
#
# Expected: NUT is FFmpeg's own container for anything uncompressed. A pixel format comes back as the one that
#   was written, as Y4M, gray10le and NV12 do, or the muxer refuses it.
# What happens: for pixel formats without a code of their own the muxer writes the code RGB[15]; both programs
#   end with 0. The reader takes the code for what it says: 10-bit luma, or luma and chroma of half the height, is
#   shown as 15-bit colours. Number and size of the pictures are right, so nothing looks broken but the picture.
# Why: the muxer looks for a raw video code and accepts the first entry of the table that it meets where there is
#   none for the format; that of rgb555le. A packet holds all bytes of the picture, and the decoder of raw video
#   uses the first two for each pixel.
# Why it matters: P010 is what hardware decoders and capture cards of more than 8 bits give, NV16 what many
#   SDI and HDMI cards give. "-c:v rawvideo" into NUT is the usual advice for keeping pictures as they are.
#   FFV1 in Matroska, or a planar format (gray10le, yuv420p10le), keeps them.
# With: FFmpeg 9.0.2 (of imageio-ffmpeg 0.8.1); the same with 5.1.9 of Debian 12 for P010, P016 and NV24.
# Output seen:
#   written     read back   pictures
#   nv12        nv12               3
#   gray10le    gray10le           3
#   yuv420p10le yuv420p10le        3
#   p010le      rgb555le           3
#   p016le      rgb555le           3
#   nv16        rgb555le           3
#   nv24        rgb555le           3
set -euo pipefail

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check imageio-ffmpeg==0.8.1
ffmpeg=$("$work/venv/bin/python" -c 'import imageio_ffmpeg; print(imageio_ffmpeg.get_ffmpeg_exe())')

cat > "$work/expected" <<'TXT'
written     read back   pictures
nv12        nv12               3
gray10le    gray10le           3
yuv420p10le yuv420p10le        3
p010le      rgb555le           3
p016le      rgb555le           3
nv16        rgb555le           3
nv24        rgb555le           3
TXT

{
    printf '%-11s %-11s %s\n' written "read back" pictures
    for format in nv12 gray10le yuv420p10le p010le p016le nv16 nv24; do
        "$ffmpeg" -v error -f lavfi -i testsrc=size=64x48:rate=25:duration=0.12 -pix_fmt "$format" \
            -c:v rawvideo -y "$work/a.nut"
        "$ffmpeg" -hide_banner -i "$work/a.nut" -map 0:v -f null - > "$work/log" 2>&1
        read_back=$(grep -m 1 -o 'Video: rawvideo ([^)]*), [a-z0-9]*' "$work/log" | sed 's/.*, //')
        pictures=$(grep -o 'frame= *[0-9]*' "$work/log" | tail -n 1 | tr -dc '0-9')
        printf '%-11s %-11s %8s\n' "$format" "$read_back" "$pictures"
    done
} > "$work/seen"
cat "$work/seen"
diff "$work/expected" "$work/seen" || { echo "NUT has changed"; exit 1; }
