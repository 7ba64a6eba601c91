"""Plays the everyday tasks on the page: how many steps each takes, and how long the machine takes for it."""

import re
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from tests.proofs.bench.page_host import (
    LOOK_EVERY_S,
    MISSING,
    PATIENCE_S,
    Host,
    browsing,
    chromium,
    host,
    page_at,
)

ROUNDS = 3
COWS = [str(number) for number in range(411, 423)]
FIELDS = 50
CYCLES = 160
"""Fields of a capture that is analysed: three pulsations, and a little."""
HANDED_OVER = 3
RECORDS_S = 1.0
"""How long a capture records before it is stopped."""
ANALYSIS_S = 300.0


class Played(NamedTuple):
    """A task from its first step until its result is seen."""

    steps: int
    seconds: float


class Before(NamedTuple):
    """A task on the page as it was, in words where it could not be done."""

    steps: str
    seconds: str = "–"


BEFORE: Mapping[str, Before] = {
    "capture": Before("1", "1.73"),
    "stop": Before("1", "1.72"),
    "label": Before("5", "1.88"),
    "find": Before("3", "2.64"),
    "look": Before("not possible: a press for each picture; the shape alone played, 2", "shape: 3.97"),
    "analyse": Before("2, without the recorded vacuum", "68.90"),
    "compare": Before("not possible: facts without σ, 3", "facts: 3.04"),
    "hand over": Before("8", "5.64"),
}
"""The page of 2026-11-26, the last before it was rebuilt, played by a script with that page's own buttons.

Medians of three rounds on 2026-11-27, by turns with three rounds of the present page on the same computer.
"""
NOTE = (
    "*Before*: the edition of 2026-11-26, the last before the page was rebuilt, the same tasks played by a"
    " script on the same computer on 2026-11-27, by turns with the present page, while others kept both"
    " processors busy: a *now* measured under another load is no comparison. Medians of {rounds}; every"
    " browser sees the page for the first time."
)


class Person:
    """Presses, chooses and types, without pauses for thought; every one of them is a step.

    Attributes:
        page: playwright's.
    """

    def __init__(self, page: Any) -> None:
        self.page = page
        page.set_default_timeout(1000 * PATIENCE_S)
        self._steps = 0
        self._began_s = 0.0

    def press(self, place: Any) -> None:
        """Presses a button, a link or a box."""
        self._step()
        place.click()

    def choose(self, place: Any, value: str) -> None:
        """Chooses one of a list."""
        self._step()
        place.select_option(value)

    def type(self, place: Any, text: str) -> None:
        """Types one text."""
        self._step()
        place.fill(text)

    def sees(self, place: Any, within_s: float = PATIENCE_S) -> Played:
        """Waits for the result; the next step begins another task."""
        place.first.wait_for(timeout=1000 * within_s)
        return self.done()

    def done(self) -> Played:
        """The result is there now; the next step begins another task."""
        played = Played(self._steps, time.monotonic() - self._began_s)
        self._steps = 0
        return played

    def _step(self) -> None:
        if self._steps == 0:
            self._began_s = time.monotonic()
        self._steps += 1


def table() -> str:
    """The tasks as a Markdown table, medians over the rounds, each on a daemon of its own."""
    executable = chromium()
    if executable is None:
        return f"Not measured: {MISSING}."
    return "\n".join(_lines([played(executable) for _ in range(ROUNDS)]))


def played(executable: str) -> dict[str, Played]:
    """All tasks once, by their names."""
    with host() as daemon, browsing(executable) as browser:
        return dict([*_at_the_cow(browser, daemon), *_at_the_desk(browser, daemon)])


def _lines(rounds: Sequence[Mapping[str, Played]]) -> Iterator[str]:
    yield "| task | steps before | steps now | s before | s now |"
    yield "|---|---|---|---|---|"
    for task in rounds[0]:
        before = BEFORE[task.split(":")[0]]
        steps = max(one[task].steps for one in rounds)
        seconds = statistics.median(one[task].seconds for one in rounds)
        yield f"| {task} | {before.steps} | {steps} | {before.seconds} | {seconds:.2f} |"
    yield ""
    yield NOTE.format(rounds=len(rounds))


def _at_the_cow(browser: Any, daemon: Host) -> Iterator[tuple[str, Played]]:
    with page_at(browser, f"{daemon.url}/#operate") as page:
        person, last = Person(page), page.locator(".last")
        person.press(page.locator("[data-do=start]"))
        yield "capture: until it records", person.sees(page.locator(".state[data-state=capturing]"))
        page.wait_for_timeout(1000 * RECORDS_S)
        person.press(page.locator("[data-do=stop]"))
        yield "stop: until the verdict", person.sees(last.locator(".badge", has_text="Complete"))
        person.type(page.get_by_label("Cow"), "410")
        person.choose(page.get_by_label("Teat"), "front left")
        person.type(page.get_by_label("Note"), "kicked the cluster off")
        stored = person.sees(last.get_by_role("heading", name=re.compile("cow 410")))
        newest = daemon.ask("/captures?limit=1")["captures"][0]
        if (newest["labels"].get("teat"), newest["note"]) != ("front left", "kicked the cluster off"):
            raise RuntimeError(f"not stored: {newest['labels']} {newest['note']}")
        yield "label: cow, teat and note stored", stored


def _at_the_desk(browser: Any, daemon: Host) -> Iterator[tuple[str, Played]]:
    for cow in COWS:
        daemon.capture(FIELDS, labels={"cow": cow})
    with page_at(browser, f"{daemon.url}/#operate") as page:
        person = Person(page)
        person.press(page.get_by_role("link", name="Captures"))
        person.type(page.get_by_label("Search"), COWS[0])
        person.press(page.locator(".capture-row", has_text=f"Cow {COWS[0]}"))
        found = person.sees(page.get_by_role("heading", level=1, name=re.compile(COWS[0])))
        yield "find: the oldest of twelve captures opened", found
    two = [daemon.capture(CYCLES, labels={"cow": name}) for name in ("423", "424")]
    yield from _of_one(browser, daemon, two[0])
    _analyse(daemon, two[1])
    yield from _of_several(browser, daemon, two)


def _of_one(browser: Any, daemon: Host, capture: str) -> Iterator[tuple[str, Played]]:
    at = f"{daemon.url}/#captures/{capture}"
    with page_at(browser, at) as page:
        person = Person(page)
        person.press(page.get_by_role("link", name="Replay"))
        person.press(page.get_by_role("button", name="Play", exact=True))
        shown = page.locator("[data-pane=picture] .replay-of", has_text=re.compile(r"^Field [1-9]"))
        yield "look: field pictures playing", person.sees(shown)
    with page_at(browser, at) as page:
        person = Person(page)
        person.press(page.get_by_role("link", name="Analysis", exact=True))
        person.press(page.get_by_role("button", name="Analyse", exact=True))
        results = page.locator(".analysis-page")
        yield "analyse: until the results are shown", person.sees(results, ANALYSIS_S)


def _of_several(browser: Any, daemon: Host, two: list[str]) -> Iterator[tuple[str, Played]]:
    with page_at(browser, f"{daemon.url}/#captures") as page:
        person = Person(page)
        for capture in two:
            person.press(_mark(page, capture))
        person.press(page.locator("[data-do=compare]"))
        cells = page.locator(f"[data-capture='{two[1]}'] td", has_text="±")
        yield "compare: two captures' quantities with σ", person.sees(cells)
    listed = [one["id"] for one in daemon.ask(f"/captures?limit={HANDED_OVER}")["captures"]]
    with page_at(browser, f"{daemon.url}/#captures") as page:
        person = Person(page)
        for capture in listed:
            person.press(_mark(page, capture))
        with page.expect_download() as download:
            person.press(page.locator("[data-do=take]"))
        download.value.path()
        yield "hand over: three captures' files on the disk", person.done()


def _mark(page: Any, capture: str) -> Any:
    """The box by which a capture in the list is chosen."""
    return page.locator(f".capture-item[data-capture='{capture}'] .capture-mark")


def _analyse(daemon: Host, capture: str) -> None:
    """As the page asks for it."""
    job = daemon.ask(f"/captures/{capture}/analysis", {"profiles": True, "configured": True, "inputs": {}})
    end_s = time.monotonic() + ANALYSIS_S
    while (state := daemon.ask(f"/jobs/{job['id']}")["state"]) in ("queued", "running"):
        if time.monotonic() > end_s:
            raise TimeoutError(f"{capture} is not analysed in time")
        time.sleep(LOOK_EVERY_S)
    if state != "done":
        raise RuntimeError(f"the analysis of {capture} is {state}")
