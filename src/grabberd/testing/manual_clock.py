"""A clock for tests: time passes when somebody waits, and only then."""


class ManualClock:
    """Stands still until somebody waits on it, and then jumps to the end of the wait.

    Attributes:
        time_ns: The time that it shows, as CLOCK_MONOTONIC would.
    """

    def __init__(self) -> None:
        self.time_ns = 77_000_000_000

    def now_ns(self) -> int:
        """The time that it shows."""
        return self.time_ns

    def sleep(self, seconds: float) -> None:
        """Jump forward by so many seconds."""
        self.time_ns += max(0, round(seconds * 1e9))

    def sleep_until_ns(self, time_ns: int) -> None:
        """Jump forward to a time."""
        self.time_ns = max(self.time_ns, time_ns)
