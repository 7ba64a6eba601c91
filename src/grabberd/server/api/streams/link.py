"""A client's link: what it has taken tells how much detail it carries."""

WINDOW = 3
"""Pictures that may be on their way: at 25 a second, a round trip of 120 ms holds none of them up."""
LOOK_S, LONGEST_LOOK_S = 1.0, 3.0
LEAST_TAKEN = 6
"""Time over which a link is judged; longer where fewer pictures than this were taken in it."""
ENOUGH = 0.85
"""Share of the pictures offered that a link has to take for its detail to stay."""
GAIN = 1.15
"""Factor by which less detail has to raise that share; else it was not the detail that was too much."""
VAIN_S = 30.0
"""Time until less detail is tried again after it was in vain."""
PATIENCE, MOST_PATIENCE = 8, 128
"""Good looks after which more detail is tried; doubled each time that it turns out to be too much."""


class Link:
    """Judges a link by the pictures that were offered and those that its client has taken.

    Args:
        levels: Number of levels of detail.
        now_s: Present time.

    Attributes:
        level: Level of detail; 0 has most.
    """

    def __init__(self, levels: int, now_s: float) -> None:
        self.level = 0
        self._coarsest = levels - 1
        self._on_the_way = 0
        self._good_looks = 0
        self._patience = PATIENCE
        self._trying_more = False
        self._share_before: float | None = None
        self._vain_until_s = now_s
        self._restart(now_s)

    @property
    def is_free(self) -> bool:
        """True if another picture may be sent."""
        return self._on_the_way < WINDOW

    def sent(self) -> None:
        """Counts a picture that was sent."""
        self._on_the_way += 1

    def taken(self, count: int) -> None:
        """Counts pictures that the client has taken."""
        count = min(count, self._on_the_way)
        self._on_the_way -= count
        self._taken += count

    def offered(self, count: int, now_s: float) -> None:
        """Counts pictures that there were, sent or not, and judges the link when there were enough."""
        self._offered += count
        passed_s = now_s - self._since_s
        if passed_s < LOOK_S or (self._taken < LEAST_TAKEN and passed_s < LONGEST_LOOK_S):
            return
        share = min((self._taken + 1) / self._offered, 1.0)
        self._keeps_up() if share >= ENOUGH else self._falls_behind(share, now_s)
        self._restart(now_s)

    def _restart(self, now_s: float) -> None:
        self._since_s, self._offered, self._taken = now_s, 0, 0

    def _keeps_up(self) -> None:
        self._share_before = None
        self._good_looks += 1
        if self._good_looks < self._patience:
            return
        if self._trying_more:
            self._patience, self._trying_more = PATIENCE, False
        if self.level:
            self.level, self._good_looks, self._trying_more = self.level - 1, 0, True

    def _falls_behind(self, share: float, now_s: float) -> None:
        self._good_looks = 0
        if self._trying_more:
            self._patience, self._trying_more = min(2 * self._patience, MOST_PATIENCE), False
        if now_s < self._vain_until_s:
            return
        if self._share_before is not None and share < GAIN * self._share_before:
            self.level -= 1
            self._share_before, self._vain_until_s = None, now_s + VAIN_S
        elif self.level < self._coarsest:
            self._share_before = share
            self.level += 1
