"""Texts in CSV are texts in every program that opens it, and numbers are numbers."""

import csv
import io

import numpy as np
import pytest

from archive.captures import slots, write
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.points_export import LEDGER, write_ledger_file
from grabberd.archive.export.table_files import cell, csv_text
from grabberd.core.chain.columns import Column

COLUMNS = (
    Column("word", "", "U", "a text"),
    Column("n", "", "i8", "a number"),
    Column("x_mm", "mm", "f8", "x"),
)


def rows(words):
    part = {
        "word": np.array(words, object),
        "n": np.full(len(words), -3, np.int64),
        "x_mm": np.full(len(words), -0.25),
    }
    return list(csv.reader(io.StringIO("".join(csv_text(COLUMNS, [part])), newline="")))[1:]


@pytest.mark.parametrize(
    "text", ["=1+1", "+49", "-2", "@SUM(A1)", "\tx", "\rx", '=HYPERLINK("http://x";"y")']
)
def test_a_text_that_a_spreadsheet_would_run_is_quoted(text):
    assert rows([text]) == [["'" + text, "-3", "-0.25"]]


@pytest.mark.parametrize("text", ["", "a=1", "cow 112", "'", "1-2", "\nx", "Ω"])
def test_any_other_text_stays_as_it_is(text):
    assert cell(text) == text
    assert rows([text])[0][0] == text


def test_so_it_is_in_the_ledger(tmp_path):
    path = write(tmp_path, slots(3))
    with CaptureReader(path) as reader:
        reader._connection.execute("PRAGMA query_only = OFF")
        reader._connection.execute("INSERT INTO ledger VALUES (3, 2, 'lost', '=cmd()')")
        folder = tmp_path / "out"
        folder.mkdir()
        write_ledger_file(reader, folder)
    [row] = csv.DictReader((folder / LEDGER).read_text().splitlines())
    assert (row["first_n"], row["reason"]) == ("3", "'=cmd()")
