"""Call numbers, computed from the sizes of their arguments like the kernel's `_IOC`."""

import ctypes

from grabberd_v4l2 import abi

_WRITE, _READ = 1, 2
_TYPE = ord("V")


def _ioc(direction: int, number: int, argument: type) -> int:
    return direction << 30 | ctypes.sizeof(argument) << 16 | _TYPE << 8 | number


def _read(number: int, argument: type) -> int:
    return _ioc(_READ, number, argument)


def _write(number: int, argument: type) -> int:
    return _ioc(_WRITE, number, argument)


def _both(number: int, argument: type) -> int:
    return _ioc(_READ | _WRITE, number, argument)


QUERYCAP = _read(0, abi.Capability)
ENUM_FMT = _both(2, abi.FmtDesc)
G_FMT = _both(4, abi.Format)
S_FMT = _both(5, abi.Format)
REQBUFS = _both(8, abi.RequestBuffers)
QUERYBUF = _both(9, abi.Buffer)
QBUF = _both(15, abi.Buffer)
DQBUF = _both(17, abi.Buffer)
STREAMON = _write(18, abi.Integer)
STREAMOFF = _write(19, abi.Integer)
G_STD = _read(23, abi.StandardSet)
S_STD = _write(24, abi.StandardSet)
ENUMSTD = _both(25, abi.Standard)
ENUMINPUT = _both(26, abi.Input)
G_INPUT = _read(38, abi.Integer)
S_INPUT = _both(39, abi.Integer)
QUERYSTD = _read(63, abi.StandardSet)
TRY_FMT = _both(64, abi.Format)
DQEVENT = _read(89, abi.Event)
SUBSCRIBE_EVENT = _write(90, abi.EventSubscription)

NAMES = {number: name for name, number in globals().items() if name.isupper() and not name.startswith("_")}
"""Names of the calls by number, for error messages."""
