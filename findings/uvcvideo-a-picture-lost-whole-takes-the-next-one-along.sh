#!/usr/bin/env bash
# uvcvideo: a picture lost as a whole takes the next one along, and is not counted
#
# Expected: the sequence number of V4L2 counts pictures that were lost: one picture that never
#   arrives leaves a gap of one, like one that arrives short of a packet.
# What happens: a picture that lacks a packet is left out and counted (sequence 21, then 23). One
#   that is lost as a whole costs two, the one after it too, and neither is counted: 21 is followed
#   by 22, of which the picture is two further on.
# Why: the driver (drivers/media/usb/uvc/uvc_video.c) tells pictures apart by one bit that toggles
#   (FID). After a whole picture is lost the bit of the next one is that of the last one seen, so
#   its data are taken for more of the last picture, and dropped; the count goes up at a toggle.
# Why it matters: "no gap in the numbers" does not mean that nothing was lost, and the loss is
#   twice what the cable lost. Times of the buffers show it (100 ms instead of 33).
# With: Linux 6.1.192 (Debian 12) and 6.12.118 (Debian 13), v4l-utils 1.22.1; YUYV, isochronous.
# How it was seen: an emulated device on a virtual USB bus (USB/IP; tests/proofs/vm/usb), the
#   kernel's own driver before it, and v4l2-ctl as reader. The number of the camera's field is in
#   every row; below, those in a buffer's rows are counted from the first fault on. grabberd has
#   no part in it.
# Output seen:
#   seq:     20 bytesused: 691200 delta: 32.001 ms  fields [[-2]]
#   seq:     21 bytesused: 691200 delta: 31.999 ms  fields [[-1]]
#   seq:     22 bytesused: 691200 delta: 100.001 ms fields [[2]]
#   seq:     23 bytesused: 691200 delta: 35.997 ms  fields [[3]]
set -euo pipefail

cd "$(dirname "$0")/../tests"
expected='[[-2]][[-1]][[2]][[3]]'
for release in bookworm trixie; do
    python3 -m proofs.vm.bare 'uvc, YUYV' '[[0, "field"]]' "$release" | tee /dev/stderr |
        sed -n 's/^cap .*: fields //p' | tr -d '\n ' | grep -qF "$expected" ||
        { echo "$release: changed" >&2; exit 1; }
done
