"""The feed of a logger: the last ten seconds for everybody, all readings for a capture, bounded for both."""

import numpy as np
from scripted_loggers import STEP_NS

from grabberd.core.channels import Anomaly, Dating
from grabberd.instrument.channels import feed as feeds
from grabberd.instrument.channels.feed import DISK_TOO_SLOW, KEPT_NS, Feed, Part

END = 2**62


def part(first, count, *anomalies):
    time_ns = (first + np.arange(count)) * STEP_NS
    posted_ns = int((first + count) * STEP_NS)
    kpa = np.ones((count, 1))
    return Part(posted_ns, time_ns, kpa, kpa, (), Dating.MONOTONIC, 0, tuple(anomalies))


def times(parts):
    return [int(time_ns) // STEP_NS for one in parts for time_ns in one.time_ns]


def test_a_follower_gets_what_is_kept_and_all_that_comes() -> None:
    feed = Feed()
    feed.put(part(0, 5))
    follower = feed.follow()
    feed.put(part(5, 5))
    assert times(follower.take(END)) == list(range(10))
    assert follower.take(END) == []


def test_it_takes_up_to_a_time_and_the_rest_later_anomalies_by_their_own_times() -> None:
    feed = Feed()
    follower = feed.follow()
    early, late = Anomaly(2 * STEP_NS, "not a number", ""), Anomaly(7 * STEP_NS, "not a number", "")
    feed.put(part(0, 10, early, late))
    (first,) = follower.take(3 * STEP_NS)
    assert (times([first]), first.anomalies) == ([0, 1, 2, 3], (early,))
    (rest,) = follower.take(END)
    assert (times([rest]), rest.anomalies) == ([4, 5, 6, 7, 8, 9], (late,))


def test_what_is_older_than_ten_seconds_is_forgotten() -> None:
    feed = Feed()
    for first in range(0, 3000, 10):
        feed.put(part(first, 10))
    kept = times(feed.follow().take(END))
    assert kept[-1] == 2999
    assert KEPT_NS // STEP_NS <= len(kept) <= KEPT_NS // STEP_NS + 10


def test_a_logger_that_floods_is_bounded_by_number(monkeypatch) -> None:
    monkeypatch.setattr(feeds, "MOST_KEPT", 100)
    feed = Feed()
    for first in range(0, 1000, 10):
        feed.put(part(first, 10)._replace(posted_ns=0))
    assert len(times(feed.follow().take(END))) <= 100


def test_what_a_stalled_disk_does_not_take_is_counted_and_told(monkeypatch) -> None:
    monkeypatch.setattr(feeds, "MOST_KEPT", 20)
    feed = Feed()
    follower = feed.follow()
    for first in range(0, 50, 10):
        feed.put(part(first, 10))
    assert times(follower.take(END)) == list(range(20))
    feed.put(part(50, 10))
    (late,) = follower.take(END)
    assert [(one.reason, one.lost) for one in late.anomalies] == [(DISK_TOO_SLOW, 30)]


def test_a_follower_that_has_closed_costs_nothing_more() -> None:
    feed = Feed()
    follower = feed.follow()
    follower.close()
    follower.close()
    feed.put(part(0, 10))
    assert follower.take(END) == []
    assert feed.followers == set()


def test_the_newest_readings_are_those_since_a_time() -> None:
    feed = Feed()
    feed.put(part(0, 10))
    feed.put(part(10, 10))
    feed.put(Part.interrupted(20 * STEP_NS, "unplugged"))
    assert times(feed.newest(15 * STEP_NS)) == list(range(10, 20))
    assert feed.newest_ns == 19 * STEP_NS
