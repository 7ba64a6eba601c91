"""Frame grabbers under the kernel's V4L2 (driver `v4l2`): PCI cards and USB dongles.

    V4l2Grabber(**options)      the driver; `V4l2Options` lists the options

System calls go through a thin layer over the kernel's ABI (`abi`, `kernel`, `node`). A stream is negotiated
before buffers are allocated (`negotiation`), and only settings that were read back are trusted; the driver's
profile determines how a buffer is split into fields (`profiles`, `fields`).
"""

from grabberd_v4l2.grabber import V4l2Grabber
from grabberd_v4l2.options import V4l2Options

__all__ = ["V4l2Grabber", "V4l2Options"]
