"""Field clock: the camera's own clock, filtered out of jittering software timestamps."""

_SLOWEST_GAIN = 0.02
_PERIOD_GAIN = _SLOWEST_GAIN**2 / 4  # critically damped: follows the camera's clock without overshoot
_PERIOD_TOLERANCE = 1e-3  # a crystal is good to some 100 ppm; more would be jitter mistaken for drift
_FREE_TOLERANCE = 1e-2


class FieldClock:
    """Prediction of field times from the nominal period, with a slow correction of phase and period.

    The gain starts as that of a running mean and falls to 1/50, so a jitter of 8 ms shrinks to some tenths of
    a millisecond within a second and a half, while a camera clock that is off by some 100 ppm is still
    followed. The period never differs from the nominal one by more than 1000 ppm, or by 1 % for a camera
    whose pace is its own.

    Args:
        period_ns: Nominal time from field to field.
        exact: True for the times of a recording, which are taken as they are.
        free: True for a camera that counts its pictures, and whose rate is known to some per mille at best.
    """

    def __init__(self, period_ns: float, exact: bool = False, *, free: bool = False) -> None:
        self._nominal_ns = period_ns
        self._exact = exact
        self._tolerance = _FREE_TOLERANCE if free else _PERIOD_TOLERANCE
        self._period_ns = period_ns
        self._base_ns = 0
        self._phase_ns = 0.0
        self._corrections = 0
        self.locked = False

    @property
    def time_ns(self) -> int:
        """Time of the current field."""
        return self._base_ns + round(self._phase_ns)

    def lock(self, time_ns: int) -> None:
        """Restart at a field's time; the learned period is kept."""
        self._base_ns, self._phase_ns = time_ns, 0.0
        self._corrections = 1
        self.locked = True

    def follow(self, period_ns: float, time_ns: int) -> None:
        """Restart at a field's time with another period."""
        self.lock(time_ns)
        self._nominal_ns = self._period_ns = period_ns

    def steps_to(self, time_ns: int) -> float:
        """Number of periods from the current field to a given time."""
        return (time_ns - self._base_ns - self._phase_ns) / self._period_ns

    def advance(self, steps: int, time_ns: int | None = None) -> int:
        """Advance to the field `steps` later and return its time, corrected by a measured one if given."""
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
        limit_ns = self._nominal_ns * self._tolerance
        period_ns = self._period_ns + _PERIOD_GAIN * late_ns
        self._period_ns = min(max(period_ns, self._nominal_ns - limit_ns), self._nominal_ns + limit_ns)

    def _move(self, phase_ns: float) -> None:
        # Whole nanoseconds go into an integer: within a day a float would lose the small ones.
        whole_ns = int(phase_ns)
        self._base_ns += whole_ns
        self._phase_ns = phase_ns - whole_ns
