"""A link that carries less gets less detail, and more again once it carries more."""

from grabberd.server.api.streams.preview import PATIENCE, VAIN_S, WINDOW, Link

LEVELS = 6
RATE_HZ = 25


class Client:
    """A client whose link carries so much a second; each level takes two thirds of the one above."""

    def __init__(self, carries: float, slowest_hz: float = RATE_HZ) -> None:
        self.link = Link(LEVELS, 0.0)
        self.carries = carries
        self.slowest_hz = slowest_hz
        self.now_s = 0.0
        self.taken = 0.0

    def watch(self, seconds: int) -> list[int]:
        """The level after each second."""
        levels = []
        for _ in range(seconds):
            for _ in range(RATE_HZ):
                self._field()
            levels.append(self.link.level)
        return levels

    def _field(self) -> None:
        self.now_s += 1 / RATE_HZ
        self.link.offered(1, self.now_s)
        if self.link.is_free:
            self.link.sent()
        size = (2 / 3) ** self.link.level
        self.taken += min(self.carries / size / RATE_HZ, self.slowest_hz / RATE_HZ)
        self.link.taken(int(self.taken))
        self.taken -= int(self.taken)


def test_a_good_link_keeps_every_detail() -> None:
    assert set(Client(carries=RATE_HZ).watch(60)) == {0}


def test_no_more_pictures_are_on_their_way_than_a_few() -> None:
    link = Link(LEVELS, 0.0)
    for _ in range(WINDOW):
        assert link.is_free
        link.sent()
    assert not link.is_free
    link.taken(1)
    assert link.is_free


def test_a_client_that_claims_more_than_it_was_sent_gets_no_more_than_others() -> None:
    link = Link(LEVELS, 0.0)
    link.taken(1000)
    for _ in range(WINDOW):
        link.sent()
    assert not link.is_free


def test_a_poor_link_gets_less_detail_until_it_carries_every_picture() -> None:
    client = Client(carries=RATE_HZ * (2 / 3) ** 3 * 1.05)
    assert client.watch(20)[-1] == 3


def test_more_is_tried_ever_less_often_while_it_is_too_much() -> None:
    client = Client(carries=RATE_HZ * (2 / 3) ** 2 * 1.05)
    client.watch(20)
    early, late = client.watch(60), client.watch(60)
    assert early.count(1) > late.count(1)
    assert late.count(2) > 50


def test_a_link_that_has_become_better_gets_its_detail_back() -> None:
    client = Client(carries=RATE_HZ * (2 / 3) ** 3)
    client.watch(20)
    client.carries = RATE_HZ
    assert client.watch(4 * PATIENCE + 8)[-1] == 0


def test_a_client_that_is_slow_by_itself_keeps_the_detail_that_costs_it_nothing() -> None:
    client = Client(carries=10 * RATE_HZ, slowest_hz=10)
    levels = client.watch(int(VAIN_S))
    assert max(levels) == 1
    assert levels[-1] == 0
