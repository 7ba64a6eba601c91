#!/usr/bin/env bash
# usbtv: a loss between two frames makes one buffer of them, unflagged and uncounted
#
# Expected: when the last chunk of a frame and the first one of the next are lost, both frames are
#   flagged (V4L2_BUF_FLAG_ERROR), or left out with a gap in the sequence numbers.
# What happens: one whole buffer is delivered in which the bottom field is of the first frame and
#   the top field of the second, 60 ms apart instead of 20. No flag, all bytes used, and the next
#   sequence number: a reader sees a frame of a wall that tears, 40 ms late.
# Why: the driver (drivers/media/usb/usbtv/usbtv-video.c) begins a frame at chunk 0 of any field
#   and ends it with the last chunk of an odd field; it flags a frame whose odd field lacks chunks
#   and does not compare the frame numbers of the two fields that it joins.
# Why it matters: the loss of two chunks of 960 bytes costs a frame and makes another one false. The
#   step in time before it (80 ms instead of 40) is the only sign.
# With: Linux 6.1.192 (Debian 12), v4l-utils 1.22.1.
# How it was seen: an emulated device on a virtual USB bus (USB/IP; tests/proofs/vm/usb), the
#   kernel's own driver before it, and v4l2-ctl as reader. The number of the camera's field is in
#   every row; below, those in a buffer's rows are counted from the first fault on. grabberd has
#   no part in it.
# Output seen:
#   seq:     15 bytesused: 829440 delta: 40.893 ms  fields [[-1], [-2]]   (top, bottom)
#   seq:     16 bytesused: 829440 delta: 80.891 ms  fields [[3], [0]]
#   seq:     17 bytesused: 829440 delta: 37.326 ms  fields [[5], [4]]
set -euo pipefail

cd "$(dirname "$0")/../tests"
expected='[[-1],[-2]][[3],[0]][[5],[4]]'
for release in bookworm; do
    python3 -m proofs.vm.bare 'usbtv' '[[1, "lost", -1], [2, "lost", 0]]' "$release" | tee /dev/stderr |
        sed -n 's/^cap .*: fields //p' | tr -d '\n ' | grep -qF "$expected" ||
        { echo "$release: changed" >&2; exit 1; }
done
