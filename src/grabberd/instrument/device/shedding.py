"""Shedding: fields are measured less often while the capture thread falls behind the camera."""

BEHIND_NS = 40_000_000
"""Less is no sign of a busy computer: its scheduler alone may cost as much, whatever the rate."""
CALM_NS = 1_000_000_000
"""Time after the capture thread was last behind until every field is measured again."""
SPARE_S = 0.2
"""Pause after each field meanwhile: five fields a second are still shown."""


class Shedding:
    """Tells the worker when to leave the processor to the capture thread.

    A field that is not taken is lost; one that is not measured is measured later, from the capture's file.
    Written by the capture thread, read by the worker.
    """

    def __init__(self) -> None:
        self._until_ns = 0

    def saw(self, behind_ns: int, now_ns: int) -> None:
        """Notes by how much the capture thread is behind the camera."""
        if behind_ns >= BEHIND_NS:
            self._until_ns = now_ns + CALM_NS

    def pause_s(self, now_ns: int) -> float:
        """Seconds that the worker has to wait for before it measures another field."""
        return SPARE_S if now_ns < self._until_ns else 0.0
