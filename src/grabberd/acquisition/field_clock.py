"""When fields are due: a camera's own clock, seen through the jitter of software timestamps."""

_SLOWEST_GAIN = 0.02
_PERIOD_GAIN = _SLOWEST_GAIN**2 / 4  # critically damped
_PERIOD_TOLERANCE = 1e-3


class FieldClock:
    """Predicts field times from the nominal period and a slow correction of phase and period.

    The gain starts as that of a running mean and falls to 1/50, so a jitter of 8 ms becomes some tenths of a
    millisecond within a second and a half, and a camera's clock that is off by some 100 ppm is followed. The
    period never leaves the nominal one by more than 1000 ppm.

    Args:
        period_ns: nominal time from field to field.
        exact: the times are those of a recording: taken as they are, nothing is smoothed.
    """

    def __init__(self, period_ns: float, exact: bool = False) -> None:
        self._nominal_ns = period_ns
        self._exact = exact
        self._period_ns = period_ns
        self._base_ns = 0
        self._phase_ns = 0.0
        self._corrections = 0
        self.locked = False

    @property
    def time_ns(self) -> int:
        """Time of the field that it has come to."""
        return self._base_ns + round(self._phase_ns)

    def lock(self, time_ns: int) -> None:
        """Begins anew at a field's time; what is known of the period stays."""
        self._base_ns, self._phase_ns = time_ns, 0.0
        self._corrections = 1
        self.locked = True

    def steps_to(self, time_ns: int) -> float:
        """How many periods a time lies after the field that it has come to."""
        return (time_ns - self._base_ns - self._phase_ns) / self._period_ns

    def advance(self, steps: int, time_ns: int | None = None) -> int:
        """Comes to the field `steps` later; its time, corrected by a measured one if there is any."""
        due_ns = self._phase_ns + steps * self._period_ns
        late_ns = 0.0 if time_ns is None else time_ns - self._base_ns - due_ns
        if self._exact:
            self._move(due_ns + late_ns)
        elif time_ns is None:
            self._move(due_ns)
        else:
            self._move(due_ns + self._gain() * late_ns)
            self._correct_period(late_ns / steps)
        return self.time_ns

    def _gain(self) -> float:
        self._corrections += 1
        return max(1 / self._corrections, _SLOWEST_GAIN)

    def _correct_period(self, late_ns: float) -> None:
        limit_ns = self._nominal_ns * _PERIOD_TOLERANCE
        period_ns = self._period_ns + _PERIOD_GAIN * late_ns
        self._period_ns = min(max(period_ns, self._nominal_ns - limit_ns), self._nominal_ns + limit_ns)

    def _move(self, phase_ns: float) -> None:
        # Whole nanoseconds go into an integer: after a day a float would have lost the small ones.
        whole_ns = int(phase_ns)
        self._base_ns += whole_ns
        self._phase_ns = phase_ns - whole_ns
