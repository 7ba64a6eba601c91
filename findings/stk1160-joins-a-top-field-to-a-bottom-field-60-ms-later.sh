#!/usr/bin/env bash
# stk1160: a lost start mark joins a top field to a bottom field 60 ms later, unflagged
#
# Expected: when the packet that marks the start of a frame is lost, that frame is lost or short,
#   and the frame before, which was whole by then, is delivered as it was.
# What happens: the frame before is still open when the mark goes missing. Its bottom field is
#   overwritten by that of the frame without a mark, and it comes out 40 ms late as a whole,
#   unflagged buffer: the top field is right, the bottom field is of the next frame. Both top
#   field and count of the next frame are gone: the sequence numbers have no gap.
# Why: the driver (drivers/media/usb/stk1160/stk1160-video.c) hands a buffer on when the *next*
#   frame begins, not when its last row has come; a mark of a bottom field only says where to write.
# Why it matters: a loss makes the frame before it false, one that a reader thinks safe. The step
#   in time before it (80 ms instead of 40) is the only sign.
# With: Linux 6.1.192 (Debian 12), saa7115 of the same kernel, v4l-utils 1.22.1.
# How it was seen: an emulated device on a virtual USB bus (USB/IP; tests/proofs/vm/usb), the
#   kernel's own driver before it, and v4l2-ctl as reader. The number of the camera's field is in
#   every row; below, those in a buffer's rows are counted from the first fault on. grabberd has
#   no part in it.
# Output seen:
#   seq:     14 bytesused: 829440 delta: 39.999 ms  fields [[-4], [-3]]   (top, bottom)
#   seq:     15 bytesused: 829440 delta: 79.999 ms  fields [[-2], [1]]
#   seq:     16 bytesused: 829440 delta: 39.998 ms  fields [[2], [3]]
set -euo pipefail

cd "$(dirname "$0")/../tests"
expected='[[-4],[-3]][[-2],[1]][[2],[3]]'
for release in bookworm; do
    python3 -m proofs.vm.bare 'stk1160' '[[0, "lost", 0]]' "$release" | tee /dev/stderr |
        sed -n 's/^cap .*: fields //p' | tr -d '\n ' | grep -qF "$expected" ||
        { echo "$release: changed" >&2; exit 1; }
done
