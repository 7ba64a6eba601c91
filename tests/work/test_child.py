"""A process answers calls side by side, in pieces, and lets go of what is given up."""

import os
import pickle
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import pytest

from archive.captures import slots, write
from grabberd.archive.capture_contents import CONTENTS
from grabberd.archive.export.page_documents import PointsQuery
from grabberd.archive.export.points_export import points_csv
from grabberd.errors import (
    CaptureFileError,
    Cause,
    IndexRebuilding,
    InputError,
    LaterVersion,
    NotFound,
    ReadingGivenUp,
    StorageError,
)
from grabberd.files.reading import check_patience
from grabberd.work.child import PIECE_BYTES, Child
from grabberd.work.frames import HEAD, NUMBER, Answer, Call, Frame, Question, packed_error, unpacked_error

PATIENCE_S = 120.0
FOR_LONG_S = time.monotonic() + 1e6


class Asked:
    """A server in threads of this process, and the pipes to and from it."""

    def __init__(self, functions: Any = CONTENTS, threads: int = 2) -> None:
        (questions, to), (back, answers) = os.pipe(), os.pipe()
        self._questions, self._answers = os.fdopen(to, "wb", buffering=0), os.fdopen(back, "rb")
        self._theirs = os.fdopen(questions, "rb", buffering=0), os.fdopen(answers, "wb")
        self._server = Child(threads, self._theirs[1], functions.__getitem__)
        self.thread = threading.Thread(target=self._server.serve, args=[self._theirs[0]])
        self.thread.start()
        assert self.answer() == (0, Answer.READY, b"")

    def read(self, number: int, name: str, *arguments: Any, until_s: float = FOR_LONG_S) -> None:
        self.ask(number, Question.CALL, pickle.dumps(Call(name, arguments, until_s)))

    def next(self, number: int, until_s: float = FOR_LONG_S) -> None:
        self.ask(number, Question.NEXT, NUMBER.pack(until_s))

    def ask(self, number: int, kind: Question, content: bytes = b"") -> None:
        self._questions.write(Frame(number, kind, content).head() + content)

    def answer(self) -> Frame:
        number, kind, length = HEAD.unpack(self._answers.read(HEAD.size))
        return Frame(number, Answer(kind), self._answers.read(length))

    def close(self) -> None:
        self._questions.close()
        self.thread.join(PATIENCE_S)
        assert not self.thread.is_alive()
        self._server.close()
        for file in (*self._theirs, self._answers):
            file.close()


@pytest.fixture
def asked() -> Iterator[Asked]:
    one = Asked()
    yield one
    one.close()


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return write(tmp_path, slots(200), measured=range(200))


def test_what_comes_whole_is_answered_at_once(asked: Asked, capture: Path) -> None:
    asked.read(7, "field_png", capture, 3)
    answer = asked.answer()
    assert (answer.number, answer.kind) == (7, Answer.WHOLE)
    assert answer.content == CONTENTS["field_png"](capture, 3)


def test_points_as_json_are_those_of_the_reader(asked: Asked, capture: Path) -> None:
    query = PointsQuery(first_n=5, end_n=9)
    asked.read(1, "points_json", capture, query)
    assert asked.answer() == (1, Answer.WHOLE, CONTENTS["points_json"](capture, query))


def test_a_file_comes_in_pieces_of_some_size_when_they_are_asked_for(asked: Asked, capture: Path) -> None:
    asked.read(1, "points_csv", capture)
    assert asked.answer() == (1, Answer.BEGUN, b"")
    pieces = []
    while True:
        asked.next(1)
        answer = asked.answer()
        if answer.kind == Answer.END:
            break
        pieces.append(answer.content)
    assert b"".join(pieces).decode() == "".join(points_csv(capture))
    assert len(pieces) > 1
    assert min(map(len, pieces[:-1])) >= PIECE_BYTES


def test_two_files_take_turns(asked: Asked, capture: Path) -> None:
    for number in (1, 2):
        asked.read(number, "points_csv", capture)
        assert asked.answer().kind == Answer.BEGUN
    pieces: dict[int, list[bytes]] = {1: [], 2: []}
    for number in (1, 2, 2, 1):
        asked.next(number)
        pieces[number].append(asked.answer().content)
    assert pieces[1] == pieces[2]


def test_what_fails_says_so_with_its_kind(asked: Asked, tmp_path: Path) -> None:
    asked.read(1, "field_png", tmp_path / "none.grab", 3)
    answer = asked.answer()
    error = unpacked_error(answer.content)
    assert answer.kind == Answer.ERROR
    assert isinstance(error, CaptureFileError)
    assert "none.grab" in error.message
    assert error.hint


class Endless:
    """A reading that ends when it is given up; `begun` has one for each that has begun."""

    def __init__(self) -> None:
        self.begun = threading.Semaphore(0)

    def __call__(self) -> bytes:
        self.begun.release()
        while True:
            check_patience("nothing")
            time.sleep(0.001)

    def pieces(self) -> Iterator[bytes]:
        yield b"."
        self()

    def has_begun(self) -> bool:
        return self.begun.acquire(timeout=PATIENCE_S)


@pytest.fixture
def endless() -> Iterator[tuple[Asked, Endless]]:
    one = Endless()
    asked = Asked({"whole": one, "pieces": one.pieces, "short": lambda: b"short"}, threads=2)
    yield asked, one
    asked.close()


def test_a_long_reading_does_not_keep_a_short_one(endless: tuple[Asked, Endless]) -> None:
    asked, reading = endless
    asked.read(1, "whole")
    assert reading.has_begun()
    asked.read(2, "short")
    assert asked.answer() == (2, Answer.WHOLE, b"short")


@pytest.mark.parametrize("name", ["whole", "pieces"])
def test_what_is_given_up_ends(endless: tuple[Asked, Endless], name: str) -> None:
    asked, reading = endless
    asked.read(1, name)
    if name == "pieces":
        assert asked.answer().kind == Answer.BEGUN
        asked.next(1)
    assert reading.has_begun()
    asked.ask(1, Question.GIVE_UP)
    answer = asked.answer()
    assert (answer.number, answer.kind) == (1, Answer.ERROR)
    assert isinstance(unpacked_error(answer.content), ReadingGivenUp)


def test_what_is_too_late_is_not_begun(endless: tuple[Asked, Endless]) -> None:
    asked, reading = endless
    asked.read(1, "whole", until_s=time.monotonic() - 1)
    assert isinstance(unpacked_error(asked.answer().content), ReadingGivenUp)
    assert not reading.begun.acquire(blocking=False)


def test_a_reading_given_up_between_two_pieces_is_closed(capture: Path) -> None:
    closed = threading.Event()

    def pieces() -> Iterator[bytes]:
        try:
            yield bytes(PIECE_BYTES)
            yield b"never asked for"
        finally:
            closed.set()

    asked = Asked({"pieces": pieces})
    asked.read(1, "pieces")
    asked.next(1)
    assert [asked.answer().kind for _ in range(2)] == [Answer.BEGUN, Answer.PIECE]
    asked.ask(1, Question.GIVE_UP)
    assert closed.wait(PATIENCE_S)
    asked.next(1)
    assert asked.answer().kind == Answer.ERROR
    asked.close()


def test_what_is_given_up_while_it_waits_for_a_thread_is_answered_at_once(
    endless: tuple[Asked, Endless],
) -> None:
    asked, reading = endless
    for number in (1, 2, 3):
        asked.read(number, "whole")
    assert reading.has_begun()
    assert reading.has_begun()
    asked.ask(3, Question.GIVE_UP)
    answer = asked.answer()
    assert (answer.number, answer.kind) == (3, Answer.ERROR)
    asked.ask(1, Question.GIVE_UP)
    assert asked.answer().number == 1
    asked.read(4, "short")  # the third is not begun after all
    assert asked.answer() == (4, Answer.WHOLE, b"short")
    assert not reading.begun.acquire(blocking=False)


def test_what_cannot_be_begun_is_answered(asked: Asked) -> None:
    asked.read(1, "no such content")
    asked.next(7)
    answers = {(answer.number, answer.kind) for answer in (asked.answer(), asked.answer())}
    assert answers == {(1, Answer.ERROR), (7, Answer.ERROR)}


@pytest.mark.parametrize(
    "error",
    [
        CaptureFileError("damaged", "restore it"),
        LaterVersion("later", "upgrade"),
        NotFound("no run 3", "list them"),
        ReadingGivenUp("too long", "ask for less"),
        StorageError("full", "make room", Cause.DISK_FAILED),
        StorageError("gone", "mount it"),
        IndexRebuilding("being made", "try again"),
        InputError("no number", "write one"),
    ],
)
def test_errors_arrive_as_they_were(error: Any) -> None:
    arrived: Any = unpacked_error(packed_error(error))
    assert type(arrived) is type(error)
    assert (arrived.message, arrived.hint) == (error.message, error.hint)
    assert getattr(arrived, "cause", None) == getattr(error, "cause", None)


def test_a_fault_of_the_program_is_told_as_one() -> None:
    fault = unpacked_error(packed_error(ZeroDivisionError("by 0")))
    assert isinstance(fault, RuntimeError)
    assert str(fault) == "ZeroDivisionError: by 0"


@pytest.mark.parametrize("error", [MemoryError(), cv2.error("(-4:Insufficient memory) Failed to allocate")])
def test_memory_that_runs_out_is_no_fault_of_the_program(error: Exception) -> None:
    told = unpacked_error(packed_error(error))
    assert isinstance(told, ReadingGivenUp)
    assert "memory" in told.message
