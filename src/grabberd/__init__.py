"""grabberd: a 50 Hz three-dimensional measuring instrument from a frame grabber and a camera behind mirrors.

As a library:

    import grabberd

    capture = grabberd.open("liner.grab")
    points = capture.points().to_dataframe()

The names in `__all__` are the library; docs/reference/python.md says how long they last. The rooms of `core`
follow the decomposition of the paper (I. Maalen-Johansen, *Close-range videometry*): `field`, `measurement`,
`geometry`, `reconstruction` are pure, arrays in and arrays out; `chain` strings them together over fields.
Threads, files, clocks and HTTP live in the rooms above `core`; `grabberd_liner` is the liner science.
"""

from importlib import import_module

__version__ = "0.1.0"

_HOMES = {
    "Analysis": "grabberd_liner.analyses.library",
    "Calibration": "grabberd.library.calibrations",
    "Capture": "grabberd.library.capture",
    "Connection": "grabberd.library.connection",
    "GrabberdError": "grabberd.errors",
    "PointTable": "grabberd.library.point_table",
    "RemoteCapture": "grabberd.library.connection",
    "calibrate": "grabberd.library.calibrations",
    "connect": "grabberd.library.connection",
    "example": "grabberd.library.examples",
    "open": "grabberd.library.capture:open_capture",
}
"""Module of each public name, and its name there where it is another.

It is imported when the name is first used, so that a script does not wait for what it has no use for. Type
checkers read the same in `__init__.pyi`.
"""

__all__ = [
    "Analysis",
    "Calibration",
    "Capture",
    "Connection",
    "GrabberdError",
    "PointTable",
    "RemoteCapture",
    "__version__",
    "calibrate",
    "connect",
    "example",
    "open",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'grabberd' has no attribute {name!r}")
    module, _, own = _HOMES[name].partition(":")
    found = globals()[name] = getattr(import_module(module), own or name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
