"""Changes to valid files, by a seeded generator: bits, pieces, lengths and numbers that nobody writes."""

import sqlite3
from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path
from random import Random
from typing import Any

NUMBERS = (
    *(b"0", b"-1", b"1e400", b"-1e-400", b"nan", b"NaN", b"inf", b"-Infinity", b"9" * 30, b"9" * 5000),
    *(b"0.1e", b"2147483648", b"-9223372036854775809", b"18446744073709551616", b"1_0", b"0x7f", b"0o8"),
    *(b"null", b"true", b"''", b'""', b"[]", b"{}", b"~", b"2026-99-99", b"\xff\xfe", b"\0", "²".encode()),
)
PIECES = (
    *(b"[" * 5000, b"{" * 5000, b'{"a":' * 5000, b"*a", b"&a [*a]", b"<<: *a", b"!!binary x", b"!!set {}"),
    *(b"- " * 300, b"\n" * 3000, b"," * 3000, b'"', b"\r", b"\t", b": ", b"=1+1", b"a" * 200_000),
)
CELLS: tuple[Any, ...] = (
    *(0, 1, 2, -1, 3, 8, 255, 256, 4096, 4097, 1 << 31, (1 << 62) - 1, (1 << 63) - 1, -(1 << 63)),
    *(
        1.5,
        1e308,
        float("inf"),
        "",
        "x",
        "9" * 5000,
        "[" * 5000,
        "[]",
        "{}",
        "null",
        "received",
        "\ud7ff",
        "\0",
    ),
    *(b"", b"\0" * 30, b"x\x9c\x03\0\0\0\0\x01", bytes.fromhex("28b52ffd e0") + b"\0" * 5),
)
TABLES = ("meta", "fields", "pictures", "ledger", "runs", "points", "channels", "readings")


def changed(random: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """The content with one to four changes."""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        content = random.choice(_CHANGES)(random, content, random.choice(others))
    return content


def _flip(random: Random, content: bytes, _: bytes) -> bytes:
    changed = bytearray(content)
    for _time in range(random.choice((1, 3, 30))):
        if changed:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _cut(random: Random, content: bytes, _: bytes) -> bytes:
    return content[: random.randrange(len(content) + 1)]


def _splice(random: Random, content: bytes, other: bytes) -> bytes:
    begin, end = random.randrange(len(content) + 1), random.randrange(len(other) + 1)
    return content[:begin] + other[end : end + random.choice((4, 100, 10_000))] + content[begin:]


def _leave_out(random: Random, content: bytes, _: bytes) -> bytes:
    begin = random.randrange(len(content) + 1)
    return content[:begin] + content[begin + random.choice((1, 8, 200)) :]


def _insert(random: Random, content: bytes, _: bytes) -> bytes:
    begin = random.randrange(len(content) + 1)
    return content[:begin] + random.choice(PIECES) + content[begin:]


def _replace_number(random: Random, content: bytes, _: bytes) -> bytes:
    """Puts a hostile number in the place of one in a text, or anywhere."""
    places = [at for at, byte in enumerate(content) if 48 <= byte <= 57] or [0]
    begin = end = random.choice(places)
    while end < len(content) and content[end] in b"0123456789.+-e":
        end += 1
    return content[:begin] + random.choice(NUMBERS) + content[end:]


def _overwrite(random: Random, content: bytes, _: bytes) -> bytes:
    """Extreme lengths and counts, as binary formats have them."""
    begin = random.randrange(len(content) + 1)
    word = random.choice((0, 1, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF)).to_bytes(
        4, random.choice(("big", "little"))
    )
    return content[:begin] + word + content[begin + 4 :]


_CHANGES = (_flip, _cut, _splice, _leave_out, _insert, _replace_number, _replace_number, _overwrite)


def change_cells(random: Random, capture: Path) -> None:
    """Changes cells of a capture file by SQL: flipped bits alone rarely get beyond its first page."""
    with closing(sqlite3.connect(capture, isolation_level=None)) as connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        if random.random() < 0.8:  # as if by earlier versions: a digest would tell of most changes at once
            connection.execute("DELETE FROM meta WHERE key GLOB 'digest*'")
        for _ in range(random.choice((1, 1, 2, 5))):
            there = {name for (name,) in connection.execute("SELECT name FROM sqlite_schema")}
            table = random.choice([table for table in TABLES if table in there])
            columns = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
            # A table that the file's format does not have has no columns.
            rows = connection.execute(f"SELECT * FROM {table}").fetchall() if columns else []
            if not rows:
                continue
            row, column = random.choice(rows), random.choice(columns)
            key = " AND ".join(f"{name} IS ?" for name in columns)
            with suppress(sqlite3.Error):  # a constraint of the table: the cell stays
                value = _cell(random, row[columns.index(column)])
                connection.execute(f"UPDATE {table} SET {column} = ? WHERE {key}", (value, *row))


def _cell(random: Random, before: Any) -> Any:
    if isinstance(before, str) and random.random() < 0.7:
        return changed(random, before.encode(), [before.encode()]).decode(errors="replace")
    if isinstance(before, bytes) and random.random() < 0.7:
        return changed(random, before, [before])
    return random.choice(CELLS)
