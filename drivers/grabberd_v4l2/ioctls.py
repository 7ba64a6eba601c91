"""Call numbers, computed from the sizes of their arguments like the kernel's `_IOC`."""

import ctypes

from grabberd_v4l2 import abi

_WRITE, _READ = 1, 2
_TYPE = ord("V")


def _ioc(direction: int, number: int, argument: type) -> int:
    # The size is part of the number: a structure that is a byte off is another call, which the kernel refuses
    # as ENOTTY, rather than memory written over.
    return direction << 30 | ctypes.sizeof(argument) << 16 | _TYPE << 8 | number


QUERYCAP = _ioc(_READ, 0, abi.Capability)
ENUM_FMT = _ioc(_READ | _WRITE, 2, abi.FmtDesc)
G_FMT = _ioc(_READ | _WRITE, 4, abi.Format)
S_FMT = _ioc(_READ | _WRITE, 5, abi.Format)
REQBUFS = _ioc(_READ | _WRITE, 8, abi.RequestBuffers)
QUERYBUF = _ioc(_READ | _WRITE, 9, abi.Buffer)
QBUF = _ioc(_READ | _WRITE, 15, abi.Buffer)
DQBUF = _ioc(_READ | _WRITE, 17, abi.Buffer)
STREAMON = _ioc(_WRITE, 18, abi.Integer)
STREAMOFF = _ioc(_WRITE, 19, abi.Integer)
G_PARM = _ioc(_READ | _WRITE, 21, abi.StreamParm)
S_PARM = _ioc(_READ | _WRITE, 22, abi.StreamParm)
G_STD = _ioc(_READ, 23, abi.StandardSet)
S_STD = _ioc(_WRITE, 24, abi.StandardSet)
ENUMSTD = _ioc(_READ | _WRITE, 25, abi.Standard)
ENUMINPUT = _ioc(_READ | _WRITE, 26, abi.Input)
G_INPUT = _ioc(_READ, 38, abi.Integer)
S_INPUT = _ioc(_READ | _WRITE, 39, abi.Integer)
QUERYSTD = _ioc(_READ, 63, abi.StandardSet)
TRY_FMT = _ioc(_READ | _WRITE, 64, abi.Format)
ENUM_FRAMESIZES = _ioc(_READ | _WRITE, 74, abi.FrmSizeEnum)
ENUM_FRAMEINTERVALS = _ioc(_READ | _WRITE, 75, abi.FrmIvalEnum)
DQEVENT = _ioc(_READ, 89, abi.Event)
SUBSCRIBE_EVENT = _ioc(_WRITE, 90, abi.EventSubscription)

NAMES = {number: name for name, number in globals().items() if name.isupper() and not name.startswith("_")}
"""Names of the calls by number, for error messages."""
