"""Frame grabbers under the kernel's V4L2 (driver `v4l2`): PCI cards and USB dongles.

    V4l2Grabber(**options)      the driver; `V4l2Options` lists the options

The calls are made through an own, small layer over the kernel's ABI (`abi`, `ioctls`, `kernel`, `node`). A
stream is negotiated before there are buffers (`negotiation`), and what was granted is what is believed; a
buffer becomes fields as its driver's profile says (`profiles`, `layout`, `times`).
"""

from grabberd_v4l2.grabber import V4l2Grabber
from grabberd_v4l2.options import V4l2Options

__all__ = ["V4l2Grabber", "V4l2Options"]
