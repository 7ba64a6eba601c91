"""grabberd: a 50 Hz three-dimensional measuring instrument from a frame grabber and a camera behind mirrors.

The rooms follow the decomposition of the paper (I. Maalen-Johansen, *Close-range videometry*): `field`,
`measurement`, `geometry`, `reconstruction` are pure, arrays in and arrays out; `processes` strings them
together over fields. Threads, files, clocks and HTTP live in the rooms above them.
"""

__version__ = "0.1.0"
