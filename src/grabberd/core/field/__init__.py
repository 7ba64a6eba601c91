"""Video fields: their lines, grey values and packed bits (paper 3.3 and 3.4).

An interlaced frame is split into two fields; the missing lines of a field may be interpolated; grey values
are quantised to a few bits and packed. Every field carries `y0` and `y_step`, so that row `k` is frame line
`y0 + k * y_step` and no later room needs to know about parity. A progressive picture is a field with all
its lines.
"""

from grabberd.core.field.field import (
    BIT_DEPTHS,
    BOTTOM,
    LARGEST_SIDE_PX,
    PROGRESSIVE,
    TOP,
    Field,
    NumberedField,
    PackedField,
    double_lines,
    map_level,
    quantise,
    split_frame,
    unpack,
)
from grabberd.core.field.packing import KernelPacking, Packing, pack
from grabberd.core.field.standards import NTSC_HZ, PAL_HZ, VIDEO_LINES, FieldOrder, standard_rate_hz

__all__ = [
    "BIT_DEPTHS",
    "BOTTOM",
    "LARGEST_SIDE_PX",
    "NTSC_HZ",
    "PAL_HZ",
    "PROGRESSIVE",
    "TOP",
    "VIDEO_LINES",
    "Field",
    "FieldOrder",
    "KernelPacking",
    "NumberedField",
    "PackedField",
    "Packing",
    "double_lines",
    "map_level",
    "pack",
    "quantise",
    "split_frame",
    "standard_rate_hz",
    "unpack",
]
