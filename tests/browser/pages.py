"""A page in a browser of its own, that is watched: for errors, and for what it asks of whom."""

import time
from typing import Any
from urllib.parse import urlsplit

TABLET = {"width": 1024, "height": 768}
PATIENCE_MS = 120_000


def until(page: Any, script: str, argument: Any = None) -> None:
    """Until a function of the page says so. Asked from here: its policy lets nobody evaluate text in it."""
    end_s = time.monotonic() + PATIENCE_MS / 1000
    while not page.evaluate(script, argument):
        assert time.monotonic() < end_s, f"never true: {script}"
        page.wait_for_timeout(50)


class Watched:
    """A page of the daemon, open in a fresh browser context.

    Attributes:
        page: playwright's.
        errors: what its console said was wrong and at which address, and what was thrown.
        foreign: addresses of other hosts that it asked for.
    """

    def __init__(
        self,
        browser: Any,
        url: str,
        *,
        size: dict[str, int] = TABLET,
        look: str = "light",
        language: str = "en",
        cookies: list[dict[str, Any]] | None = None,
        ready: str = "[data-panel], .sign-in",
    ) -> None:
        self.context = browser.new_context(
            viewport=size, color_scheme=look, locale=language, accept_downloads=True
        )
        self.context.add_cookies(cookies or [])
        self.context.set_default_timeout(PATIENCE_MS)
        self.page = self.context.new_page()
        self.errors: list[tuple[str, str]] = []
        self.foreign: list[str] = []
        self.expected: tuple[str, ...] = ()
        self._host = urlsplit(url).netloc
        self.page.on("pageerror", lambda error: self.errors.append((str(error), "")))
        self.page.on("console", self._hear)
        self.page.on("request", self._see)
        self.page.goto(url)
        self.page.wait_for_selector(ready)

    def expect_errors(self, *parts: str) -> None:
        """Errors with one of these words in them belong to the test."""
        self.expected += parts

    def check(self) -> None:
        """Nothing was wrong, and nobody else was asked; all that was said is in the assertion's words."""
        assert self.foreign == []
        wrong = [(text, at) for text, at in self.errors if not any(part in text for part in self.expected)]
        assert not wrong, "\n".join(f"{text} {at}" for text, at in wrong)

    def close(self) -> None:
        self.context.close()

    def _hear(self, message: Any) -> None:
        if message.type == "error":
            self.errors.append((message.text, message.location.get("url", "")))

    def _see(self, request: Any) -> None:
        place = urlsplit(request.url)
        if place.scheme in ("http", "https", "ws", "wss") and place.netloc != self._host:
            self.foreign.append(request.url)
