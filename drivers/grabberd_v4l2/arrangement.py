"""Arrangement of fields in the buffers of a kernel driver."""

from enum import IntEnum

from grabberd_v4l2 import abi


class Arrangement(IntEnum):
    """V4L2_FIELD_*; a profile calls them by their names in small letters.

    Woven: the lines of two fields alternate in one buffer. Stacked: one field lies below the other.
    """

    ANY = abi.FIELD_ANY
    NONE = abi.FIELD_NONE
    TOP = abi.FIELD_TOP
    BOTTOM = abi.FIELD_BOTTOM
    INTERLACED = abi.FIELD_INTERLACED
    SEQ_TB = abi.FIELD_SEQ_TB
    SEQ_BT = abi.FIELD_SEQ_BT
    ALTERNATE = abi.FIELD_ALTERNATE
    INTERLACED_TB = abi.FIELD_INTERLACED_TB
    INTERLACED_BT = abi.FIELD_INTERLACED_BT
