"""Every field's points for whoever follows; who is late for a moment misses none."""

import asyncio
import threading
from collections.abc import Callable, Coroutine
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from running import PATIENCE_S, wait_until_it_accepts

from grabberd.documents.points_frame import PointsFrame, decoded, symmetric
from grabberd.instrument.device.worker import NEWEST
from grabberd.server.api.streams import feeds
from grabberd.server.api.streams.feeds import KEPT, PointsFeed
from grabberd.server.daemon.service import Service
from server.api.conftest import service_in


def followed(folder: Path, work: Callable[[Service, PointsFeed], Coroutine[Any, Any, None]]) -> None:
    service = service_in(folder, pace="real")
    service.start()
    try:
        wait_until_it_accepts(service)
        asyncio.run(work(service, PointsFeed(service.instrument(None), service.clock)))
    finally:
        service.stop()


def threads() -> list[str]:
    return [one.name for one in threading.enumerate() if one.name.startswith("points-")]


def test_every_measured_field_comes_once_with_its_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As many as a busy computer needs: how late one may be is not the subject here.
    monkeypatch.setattr(feeds, "KEPT", 1000)
    monkeypatch.setattr("grabberd.instrument.device.worker.NEWEST", 1000)

    async def work(service: Service, feed: PointsFeed) -> None:
        worker = service.instrument(None).worker
        with feed.listening() as listener:
            message = await listener.next(PATIENCE_S)
            live = worker.live
            assert message is not None
            assert live is not None
            sequences, numbers = [], []
            for _ in range(20):
                message = await listener.next(PATIENCE_S)
                assert message is not None
                frame = decoded(message.content)
                sequences.append(frame.sequence)
                numbers.append(frame.n)
                live = worker.live
                assert live is not None
                if live.measured.n == frame.n:
                    points = live.measured.points
                    assert frame.time_ns == live.measured.time_ns
                    assert frame.published_ns == live.published_ns
                    assert frame.target.tolist() == points.target.tolist()
                    assert frame.xyz_mm.tolist() == points.xyz_mm.tolist()
                    assert symmetric(frame.covariance_mm2) == pytest.approx(points.covariance_mm2, rel=1e-6)
        assert sequences == list(range(sequences[0], sequences[0] + 20))
        assert numbers == sorted(set(numbers))

    followed(tmp_path, work)


def test_it_is_encoded_once_for_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    encoded: list[int] = []
    encode = feeds.encoded
    monkeypatch.setattr(feeds, "encoded", lambda frame: encoded.append(frame.n) or encode(frame))

    async def work(_: Service, feed: PointsFeed) -> None:
        with feed.listening() as one, feed.listening() as other:
            for _ in range(5):
                assert await one.next(PATIENCE_S) is await other.next(PATIENCE_S)
        assert len(encoded) == len(set(encoded))

    followed(tmp_path, work)


def test_who_is_late_misses_none_and_who_is_very_late_gets_the_newest(tmp_path: Path) -> None:
    async def work(_: Service, feed: PointsFeed) -> None:
        with feed.listening() as quick, feed.listening() as late, feed.listening() as very_late:
            newest = await quick.next(PATIENCE_S)
            assert newest is not None
            first = decoded(newest.content).sequence
            for count in range(KEPT + 2):
                if count == 3:
                    taken = [await late.next(PATIENCE_S) for _ in range(4)]
                    oldest, *after = [decoded(one.content).sequence - first for one in taken if one]
                    assert after == [oldest + 1, oldest + 2, oldest + 3]
                    assert oldest == 0 or oldest >= KEPT  # a busy computer may make it very late, too
                newest = await quick.next(PATIENCE_S) or newest
            jumped = await very_late.next(PATIENCE_S)
            assert jumped is not None
            assert decoded(jumped.content).sequence >= decoded(newest.content).sequence > first + KEPT

    followed(tmp_path, work)


def test_nothing_waits_for_fields_while_nobody_listens(tmp_path: Path) -> None:
    async def work(_: Service, feed: PointsFeed) -> None:
        assert not threads()
        with feed.listening() as listener:
            await listener.next(PATIENCE_S)
            assert threads() == ["points-simulated"]
        for _ in range(200):
            if not threads():
                return
            await asyncio.sleep(0.05)
        raise AssertionError(threads())

    followed(tmp_path, work)


def test_who_comes_back_gets_no_field_of_before(tmp_path: Path) -> None:
    async def work(service: Service, feed: PointsFeed) -> None:
        with feed.listening() as listener:
            await listener.next(PATIENCE_S)
        before = service.instrument(None).worker.live
        assert before is not None
        with feed.listening() as listener:
            message = await listener.next(PATIENCE_S)
        assert message is not None
        assert decoded(message.content).published_ns > before.published_ns

    followed(tmp_path, work)


def test_its_end_ends_all_who_wait(tmp_path: Path) -> None:
    async def work(_: Service, feed: PointsFeed) -> None:
        with feed.listening() as listener:
            await listener.next(PATIENCE_S)
            feed.close()
            assert await listener.next(PATIENCE_S) is None

    followed(tmp_path, work)


def test_a_field_that_cannot_be_encoded_is_logged_once_and_the_next_ones_come(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    encode = feeds.encoded
    failures = iter([True] * 3)

    def failing(frame: PointsFrame) -> bytes:
        if next(failures, False):
            raise RuntimeError("no such points")
        return encode(frame)

    monkeypatch.setattr(feeds, "encoded", failing)

    async def work(_: Service, feed: PointsFeed) -> None:
        with feed.listening() as listener:
            message = await listener.next(PATIENCE_S)
            assert message is not None
            assert next(failures, "none left") == "none left"

    followed(tmp_path, work)
    assert caplog.text.count("points cannot be sent") == 1


def test_fields_that_are_published_at_once_come_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when a capture is caught up: faster than a thread that waits for them gets to run."""
    sequences: list[int] = []
    encode = feeds.encoded
    monkeypatch.setattr(feeds, "encoded", lambda frame: sequences.append(frame.sequence) or encode(frame))

    async def work(service: Service, feed: PointsFeed) -> None:
        worker, setup = service.instrument(None).worker, service.instrument(None).setup.measuring
        assert setup is not None
        with feed.listening() as listener:
            assert await listener.next(PATIENCE_S) is not None
            with worker.published:
                assert worker.live is not None
                for _ in range(5):
                    worker._publish(worker.live.measured, setup, 0)
                last = worker.live.number
            while sequences[-1] < last:
                assert await listener.next(PATIENCE_S) is not None
        assert sequences == list(range(sequences[0], sequences[-1] + 1))

    followed(tmp_path, work)


def test_what_could_not_be_kept_for_the_feed_shows_as_a_gap(tmp_path: Path) -> None:
    async def work(service: Service, feed: PointsFeed) -> None:
        worker, setup = service.instrument(None).worker, service.instrument(None).setup.measuring
        assert setup is not None
        with feed.listening() as listener:
            message = await listener.next(PATIENCE_S)
            assert message is not None
            last = decoded(message.content).sequence
            with worker.published:
                assert worker.live is not None
                for _ in range(3 * NEWEST):
                    worker._publish(worker.live.measured, setup, 0)
            sequences = [last]
            while sequences[-1] < last + 3 * NEWEST:
                message = await listener.next(PATIENCE_S)
                assert message is not None
                sequences.append(decoded(message.content).sequence)
        assert max(after - before for before, after in pairwise(sequences)) > NEWEST

    followed(tmp_path, work)


def test_who_could_not_be_served_does_not_keep_the_next_from_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("no thread")

    async def work(_: Service, feed: PointsFeed) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, "start", refuse)
            with pytest.raises(RuntimeError, match="no thread"), feed.listening():
                pass
        with feed.listening() as listener:
            assert await listener.next(PATIENCE_S) is not None

    followed(tmp_path, work)
