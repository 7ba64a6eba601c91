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

__version__ = "0.1.0"

_HOMES = {
    "Calibration": "grabberd.library.calibrations:Calibration",
    "Capture": "grabberd.library.capture:Capture",
    "Connection": "grabberd.library.connection:Connection",
    "GrabberdError": "grabberd.errors:GrabberdError",
    "PointTable": "grabberd.library.tables:PointTable",
    "RemoteCapture": "grabberd.library.connection:RemoteCapture",
    "calibrate": "grabberd.library.calibrations:calibrate",
    "connect": "grabberd.library.connection:connect",
    "example": "grabberd.library.examples:example",
    "open": "grabberd.library.capture:open_capture",
}
"""Module of each public name of the program's own, and its name there; those of extensions win.

It is imported when the name is first used, so that a script does not wait for what it has no use for. Type
checkers read the same in `__init__.pyi`.
"""


def _homes() -> dict[str, str]:
    from grabberd.extension import extensions  # noqa: PLC0415 - `import grabberd` imports nothing else

    return _HOMES | {name: home for one in extensions() for name, home in one.library.items()}


def __getattr__(name: str) -> object:
    from grabberd.extension import load  # noqa: PLC0415

    homes = _homes()
    if name == "__all__":
        found: object = sorted(["__version__", *homes])
    elif name in homes:
        found = load(homes[name])
    else:
        raise AttributeError(f"module 'grabberd' has no attribute {name!r}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), "__all__", *_homes()})
