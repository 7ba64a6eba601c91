"""What the soak says of a daemon and its files can be believed."""

from collections import Counter
from random import Random

import numpy as np
import pytest

from archive.captures import slots, write
from grabberd.core.ledger import Outcome

from .soak import Seen, broken, growth_mb
from .soak_captures import order
from .soak_check import check_capture, check_captures, in_words
from .soak_clients import Host, visit
from .witness import Stalls

WELL = Seen(
    outcomes=Counter({Outcome.RECEIVED: 30_000}),
    latency_ms=np.full(1000, 5.0),
    memory_mb=[200.0, 230.0, 240.0, 241.0, 240.0, 241.0],
    stalls=Stalls(0.004, 0),
    waited_s=0.0,
    shares={},
    load=0.5,
)


def test_a_daemon_that_kept_its_promises_has_broken_none():
    assert list(broken(WELL)) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"outcomes": Counter({Outcome.RECEIVED: 29_999, Outcome.LOST: 1})}, "1 fields did not come whole"),
        (
            {"outcomes": Counter({Outcome.RECEIVED: 29_998, Outcome.OVERRUN: 2})},
            "2 fields did not come whole",
        ),
        ({"memory_mb": [200.0, 230.0, 240.0, 250.0, 260.0, 270.0]}, "memory has grown by 20 MB"),
        ({"latency_ms": np.append(np.full(900, 5.0), np.full(100, 900.0))}, "later than 900 ms"),
        ({"latency_ms": np.empty(0)}, "later than inf ms"),
    ],
)
def test_a_broken_promise_is_told(change, words):
    (told,) = broken(WELL._replace(**change))
    assert words in told


def test_fields_lost_while_the_machine_stood_still_are_not_the_daemon_s():
    lost = WELL._replace(outcomes=Counter({Outcome.RECEIVED: 29_980, Outcome.LOST: 20}))
    assert list(broken(lost._replace(stalls=Stalls(0.5, 1)))) == []
    assert list(broken(lost._replace(waited_s=0.5))) == []
    assert list(broken(lost._replace(waited_s=0.1)))


def test_memory_that_is_flat_after_warming_up_has_not_grown():
    assert growth_mb([100.0, 200.0, 300.0, 300.0, 300.0, 300.0]) == 0.0


def test_a_whole_capture_has_no_fault(tmp_path):
    checked = check_capture(write(tmp_path, slots(60), measured=range(60)))
    assert (checked.total, checked.received, checked.measured, checked.complete) == (60, 60, 60, True)
    assert checked.faults == ()


def test_fields_without_points_are_a_fault(tmp_path):
    write(tmp_path, slots(60), measured=range(59))
    assert list(in_words(check_captures(tmp_path))) == ["liner.grab: of 60 fields 59 have been measured"]


def test_a_capture_that_was_not_sealed_is_a_fault(tmp_path):
    path = write(tmp_path, slots(10), measured=range(10))
    path.rename(path.with_suffix(".grab.part"))
    (checked,) = check_captures(tmp_path)
    assert "is not sealed" in checked.faults


def test_a_damaged_file_is_a_fault(tmp_path):
    path = write(tmp_path, slots(60), measured=range(60))
    content = bytearray(path.read_bytes())
    content[5000:9000] = bytes(4000)
    path.write_bytes(content)
    assert check_capture(path).faults


def test_a_client_whom_nobody_serves_says_what_failed():
    found = visit(Host(9), Random(3))
    assert found.failure
    assert found.failure.startswith(f"{found.what}: ")


class Ordered:
    """A daemon that seals what it is asked for at once."""

    def __init__(self):
        self.posted = []

    def post(self, path, document=None):
        self.posted.append((path.rsplit("/", 1)[1], document))
        return {"id": "one"}

    def json(self, path):
        return {"id": "one", "verdict": "complete"}


def test_the_seed_decides_which_captures_are_ordered():
    first, again, other = Ordered(), Ordered(), Ordered()
    for host, seed in ((first, 7), (again, 7), (other, 8)):
        random = Random(seed)
        for _ in range(12):
            order(host, random, lambda _: None)
    assert first.posted == again.posted != other.posted
    assert {"captures", "stop", "trigger"} == {what for what, _ in first.posted}
