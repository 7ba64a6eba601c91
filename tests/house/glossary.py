"""The glossary of docs/conventions.md, and the names in the source that break it."""

import fnmatch
import re
import sys
from collections.abc import Iterator
from typing import NamedTuple

from .source import ROOT, modules, names, relative, words

CONVENTIONS = ROOT / "docs" / "conventions.md"


class Ban(NamedTuple):
    """A word that no name may contain, what to say instead, and the files that may use it all the same."""

    word: str
    instead: str
    allowed: tuple[str, ...] = ()

    def allows(self, file: str) -> bool:
        """True if the word has its own meaning in that file."""
        return any(fnmatch.fnmatch(file, pattern) for pattern in self.allowed)


class Breach(NamedTuple):
    """A name that breaks the glossary."""

    file: str
    line: int
    name: str
    ban: Ban

    def __str__(self) -> str:
        advice = f"say {self.ban.instead}"
        if self.ban.allowed:
            advice = f"it means {self.ban.instead}, in {', '.join(self.ban.allowed)} alone"
        return f"{self.file}:{self.line}: `{self.name}` contains `{self.ban.word}`: {advice}"


def bans() -> dict[str, Ban]:
    """Every banned word of the glossary: synonyms everywhere, reserved words outside of their own files."""
    text = CONVENTIONS.read_text(encoding="utf-8")
    synonyms = {
        word: Ban(word, _plain(row[0]))
        for row in _rows(text, "| word | meaning | never |")
        for word in _quoted(row[2])
    }
    reserved = {
        word: Ban(word, _plain(row[1]), tuple(_quoted(row[2])))
        for row in _rows(text, "| reserved word | means only | in |")
        for word in _quoted(row[0])
    }
    return synonyms | reserved


def breaches() -> Iterator[Breach]:
    """Every name in the source that contains a banned word."""
    banned = bans()
    for path in modules().values():
        file = relative(path)
        for line, name in dict.fromkeys(names(path)):
            for word in words(name):
                if word in banned and not banned[word].allows(file):
                    yield Breach(file, line, name, banned[word])


def main() -> int:
    """Lists the breaches; the exit status is 1 if there is any."""
    found = list(breaches())
    for breach in found:
        print(breach)
    print(f"{len(bans())} banned words of docs/conventions.md: {len(found)} names break the glossary")
    return 1 if found else 0


def _rows(text: str, head: str) -> Iterator[list[str]]:
    """The cells of every row of the table with that head."""
    if head not in text:
        raise LookupError(f"{CONVENTIONS.name} has no table with the head {head}")
    for line in text.split(head, 1)[1].splitlines()[2:]:
        if not line.startswith("|"):
            return
        yield [cell.strip() for cell in line.strip("|").split("|")]


def _quoted(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def _plain(cell: str) -> str:
    return cell.replace("*", "")


if __name__ == "__main__":
    sys.exit(main())
