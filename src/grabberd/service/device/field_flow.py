"""Since when fields come, and since when they do not."""


class Flow:
    """Times of the clock, in ns, at which the first and the newest field came since the last step."""

    def __init__(self, now_ns: int) -> None:
        self._first_ns: int | None = None
        self._newest_ns = now_ns

    @property
    def flowed_s(self) -> float:
        """For how long fields came."""
        return 0.0 if self._first_ns is None else (self._newest_ns - self._first_ns) / 1e9

    def came(self, now_ns: int) -> None:
        """A field has come."""
        self._first_ns = now_ns if self._first_ns is None else self._first_ns
        self._newest_ns = now_ns

    def excuse(self, now_ns: int) -> None:
        """That none has come until now is no wonder."""
        self._newest_ns = max(self._newest_ns, now_ns)

    def silent_s(self, now_ns: int) -> float:
        """For how long none has come."""
        return (now_ns - self._newest_ns) / 1e9
