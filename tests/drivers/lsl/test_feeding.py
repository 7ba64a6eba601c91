"""Events as they are told while the daemon answers, does not, and answers again."""

import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.lsl.test_events import device
from grabberd.client.daemon import Daemon
from grabberd.errors import GrabberdError, InputError, NotReady
from grabberd_lsl import feeding
from grabberd_lsl.feeding import only_device
from grabberd_lsl.outlets import Event, Outlets


class Scripted:
    """A daemon that gives one answer after the other, and ends the feeding after the last."""

    def __init__(self, *answers: Any) -> None:
        self.stopped = threading.Event()
        self._answers = list(answers)

    def ask(self, path: str) -> Any:
        if path.startswith("/api/v1/captures"):
            return {"captures": []}
        answer = self._answers.pop(0)
        if not self._answers:
            self.stopped.set()
        if isinstance(answer, Exception):
            raise answer
        return answer


class Heard:
    """Outlets that keep what they are told; from a given moment on somebody hears them."""

    device = "north"

    def __init__(self) -> None:
        self.told: list[Event] = []
        self.is_heard = False

    def tell(self, event: Event) -> None:
        self.told.append(event)


def told_by(*answers: Any, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.setattr(feeding, "ASK_EVERY_S", 0)
    daemon, outlets = Scripted(*answers), Heard()
    feeding._tell_events(cast("Daemon", daemon), cast("Outlets", outlets), daemon.stopped)
    return [event.name for event in outlets.told]


def fed(*answers: Exception | int, monkeypatch: pytest.MonkeyPatch) -> tuple[int, list[str]]:
    """Number of fields pushed, and what was said, as the daemon streams so many fields or fails, in turn."""
    stopped, waiting, said, pushed = threading.Event(), list(answers), list[str](), list[int]()

    def stream(*_: object) -> Iterator[int]:
        answer = waiting.pop(0)
        if not waiting:
            stopped.set()
        if isinstance(answer, Exception):
            raise answer
        yield from range(answer)
        raise NotReady("it has ended", "start it again")

    monkeypatch.setattr(feeding, "follow_points", stream)
    monkeypatch.setattr(feeding, "AGAIN_S", 0)
    monkeypatch.setattr(feeding, "_tell_events", lambda *_: None)
    outlets = SimpleNamespace(device="north", begin=lambda: None, push=pushed.append)
    feeding.feed(cast("Daemon", None), cast("Outlets", outlets), said.append, stopped)
    return len(pushed), said


def test_a_daemon_that_is_started_again_is_followed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    away, refused = NotReady("nobody answers", "start one"), GrabberdError("too many streams", "close some")
    pushed, said = fed(away, away, 3, away, refused, 1, monkeypatch=monkeypatch)
    assert pushed == 4
    assert said == [
        "nobody answers; start one",
        "it has ended; start it again",
        "nobody answers; start one",
        "too many streams; close some",
    ]


def test_one_that_refuses_from_the_beginning_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(GrabberdError, match="expired"):
        fed(GrabberdError("the token has expired", "make another"), 1, monkeypatch=monkeypatch)


def state(**fields: int) -> dict[str, Any]:
    return {"devices": {"north": device(**fields)}}


def test_a_daemon_that_is_away_is_told_once_and_told_when_it_is_back(monkeypatch: pytest.MonkeyPatch) -> None:
    away = NotReady("no daemon answers", "start one")
    told = told_by(state(), away, away, state(lost=2), state(lost=2), monkeypatch=monkeypatch)
    assert told == ["health", "daemon_away", "daemon_back", "fields_not_received"]


def test_a_device_that_is_no_longer_there_is_told_like_it(monkeypatch: pytest.MonkeyPatch) -> None:
    assert told_by(state(), {"devices": {}}, monkeypatch=monkeypatch) == ["health", "daemon_away"]


def test_the_only_device_is_meant_where_none_is_named() -> None:
    assert only_device(cast("Daemon", Scripted(state())), None) == "north"
    assert only_device(cast("Daemon", Scripted({"devices": {"a": {}, "b": {}}})), "b") == "b"


@pytest.mark.parametrize(
    ("named", "words"), [(None, "there are several devices"), ("c", "there is no device c")]
)
def test_otherwise_one_has_to_be_named(named: str | None, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        only_device(cast("Daemon", Scripted({"devices": {"a": {}, "b": {}}})), named)
    assert caught.value.hint == "name one of: a, b"
