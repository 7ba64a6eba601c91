"""Tables that people bring: read rightly, or refused for the true reason."""

import itertools
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.bounded_documents import decoded
from grabberd.tables import MOST_ROWS, Column, Table, TableError, keyed_cells, number_of

ROWS = 60
KPA = [42 + (k % 7) / 8 for k in range(ROWS)]
TIME_AND_VACUUM = [("time",), ("pulsation_vacuum",)]


def read(content: str | bytes, *, may_count: bool = True) -> tuple[list[float], list[float]]:
    """Times and vacuums, whatever the unit of time."""
    text = decoded(content) if isinstance(content, bytes) else content
    table = Table(text, TIME_AND_VACUUM, ("liner_vacuum",), may_count=may_count)
    time, vacuum = table.place("time_ms", "time_s"), table.place("pulsation_vacuum_kpa")
    assert time is not None, table.missing("time_ms or time_s")
    assert vacuum is not None, table.missing("pulsation_vacuum_kpa")
    places = {"time": time, "vacuum": vacuum, "liner": table.place("liner_vacuum_kpa")}
    cells = table.cells({name: place for name, place in places.items() if place is not None})
    numbers = cells.numbers(cells.columns)
    return numbers["time"], numbers["vacuum"]


def rows(form: str, sign: str = ".") -> str:
    """Rows by a form with {n} from 1, {ms}, {s} and {kpa}; their decimal sign is another one where wished."""
    lines = []
    for k, kpa in enumerate(KPA):
        numbers = {"n": k + 1, "ms": 1000 + 10 * k, "s": f"{k / 100:.2f}", "kpa": f"{kpa:.3f}"}
        lines.append(form.format(**{name: str(value).replace(".", sign) for name, value in numbers.items()}))
    return "".join(f"{line}\n" for line in lines)


HEADS = {
    "names with suffixes": ("{q}time_ms{q}{sep}{q}pulsation_vacuum_kpa{q}\n", "{{ms}}{sep}{{kpa}}"),
    "units in brackets": ("{q}Time [ms]{q}{sep}{q}Pulsation vacuum (kPa){q}\n", "{{ms}}{sep}{{kpa}}"),
    "a line of units": ("time{sep}pulsation_vacuum\nms{sep}kPa\n", "{{ms}}{sep}{{kpa}}"),
    "a line of units in brackets": ("time{sep}pulsation_vacuum\n[ms]{sep}[kPa]\n", "{{ms}}{sep}{{kpa}}"),
    "units twice": ("time_ms{sep}pulsation_vacuum_kpa\nms{sep}kPa\n", "{{ms}}{sep}{{kpa}}"),
    "comments before it": ("# logger 7, 200 Hz\n#\ntime_ms{sep}pulsation_vacuum_kpa\n", "{{ms}}{sep}{{kpa}}"),
    "words before it": (
        'Logger: 7, 200 Hz\nStart: 2026-03-01; "barn 2"\n\ntime_ms{sep}pulsation_vacuum_kpa\n',
        "{{ms}}{sep}{{kpa}}",
    ),
    "a header as a comment": ("# time_ms{sep}pulsation_vacuum_kpa\n", "{{ms}}{sep}{{kpa}}"),
    "row names in quotes": ('"time_ms"{sep}"pulsation_vacuum_kpa"\n', '"{{n}}"{sep}{{ms}}{sep}{{kpa}}'),
    "row names with an empty head": (
        '""{sep}"time_ms"{sep}"pulsation_vacuum_kpa"\n',
        '"{{n}}"{sep}{{ms}}{sep}{{kpa}}',
    ),
    "a comment at every row": (
        "time_ms{sep}pulsation_vacuum_kpa{sep}comment\n",
        '{{ms}}{sep}{{kpa}}{sep}"calm, then ""wild""; all | right"',
    ),
}
SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|", "blank": " "}
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16")
ENDS = ("\n", "\r\n", "\r")
MATRIX = list(itertools.product(HEADS, SEPARATORS, ".,"))


@pytest.mark.parametrize(("head", "separator", "sign"), MATRIX, ids=["; ".join(one) for one in MATRIX])
def test_every_head_is_read_with_every_separator_decimal_sign_encoding_and_line_end(head, separator, sign):
    """Decimal commas between commas are in quotes; some writers quote all names, some none."""
    sep = SEPARATORS[separator]
    header, form = (part.format(sep=sep, q='"' if sep == " " else "") for part in HEADS[head])
    if sep == sign:
        form = form.replace("{kpa}", '"{kpa}"')
    for encoding, end in itertools.product(ENCODINGS, ENDS):
        text = (header + rows(form, sign)).replace("\n", end)
        assert read(text.encode(encoding)) == ([1000 + 10 * k for k in range(ROWS)], KPA)


PROGRAMS = {
    "R, write.csv": '"","time_ms","pulsation_vacuum_kpa"\n' + rows('"{n}",{ms},{kpa}'),
    "R, write.csv2": '"";"time_ms";"pulsation_vacuum_kpa"\n' + rows('"{n}";{ms};{kpa}', ","),
    "R, write.table": '"time_ms" "pulsation_vacuum_kpa"\n' + rows('"{n}" {ms} {kpa}'),
    "R, write.table(sep = ',')": '"time_ms","pulsation_vacuum_kpa"\n' + rows('"{n}",{ms},{kpa}'),
    "R, write.table(quote = FALSE)": "time_ms pulsation_vacuum_kpa\n" + rows("{n} {ms} {kpa}"),
    "R, write.table(sep = ',', quote = FALSE)": "time_ms,pulsation_vacuum_kpa\n" + rows("{n},{ms},{kpa}"),
    "R, write.table(row.names = FALSE)": '"time_ms" "pulsation_vacuum_kpa"\n' + rows("{ms} {kpa}"),
    "R, write.table(col.names = NA)": '"" "time_ms" "pulsation_vacuum_kpa"\n' + rows('"{n}" {ms} {kpa}'),
    "pandas, to_csv": ",time_ms,pulsation_vacuum_kpa\n" + rows("{n},{ms},{kpa}"),
    "pandas, to_csv(sep=';', decimal=',')": ";time_ms;pulsation_vacuum_kpa\n" + rows("{n};{ms};{kpa}", ","),
    "numpy, savetxt": "# time_s pulsation_vacuum_kpa\n" + rows("{s}e+00 {kpa}0e+00"),
    "Excel, CSV UTF-8": (
        "\ufefftime_ms;pulsation_vacuum_kpa;\r\n" + rows("{ms};{kpa};\r", ",") + ";;\r\n"
    ).encode(),
    "Excel, Unicode Text": ("time_ms\tpulsation_vacuum_kpa\n" + rows("{ms}\t{kpa}", ",")).encode("utf-16"),
    "Excel, CSV (Macintosh)": ("time_ms,pulsation_vacuum_kpa\n" + rows("{ms},{kpa}")).replace("\n", "\r"),
    "Excel, sep=": "sep=;\r\ntime_ms;pulsation_vacuum_kpa\r\n" + rows("{ms};{kpa}", ","),
    "LibreOffice, all texts in quotes": '"time_ms";"pulsation_vacuum_kpa"\n' + rows('"{ms}";"{kpa}"', ","),
    "MATLAB, writetable": "time_ms,pulsation_vacuum_kpa\n" + rows("{ms},{kpa}"),
    "LabVIEW, .lvm": "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
    "Time\t10:00:00,0000\n***End_of_Header***\t\n\t\nChannels\t1\t\nY_Unit_Label\tkPa\t\n***End_of_Header***\t\t\n"
    "time_s\tpulsation_vacuum_kpa\tComment\n" + rows("{s}\t{kpa}\t", ","),
    "Campbell, TOA5": '"TOA5","CR1000","1234","CR1000.Std.32","CPU:vacuum.CR1","5","Table1"\n'
    '"TIMESTAMP","RECORD","time_s","pulsation_vacuum"\n"TS","RN","s","kPa"\n"","","Smp","Avg"\n'
    + rows('"2026-03-01 10:00:00",{n},{s},{kpa}'),
    "HOBO": '"Plot Title: barn 2"\n"#","time (s)","Pulsation vacuum (kPa)","Host Connected"\n'
    + rows("{n},{s},{kpa},"),
    "Testo": "Device;testo 440;SN;123\n;;\n" + "time [s];Pulsation vacuum [kPa]\n" + rows("{s};{kpa}", ","),
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_what_a_program_writes_is_read(program):
    times, vacuum = read(PROGRAMS[program])
    assert vacuum == KPA
    assert [round(time - times[0], 6) for time in times[:3]] in ([0, 10, 20], [0, 0.01, 0.02])


def test_every_program_is_in_the_reference():
    page = (Path(__file__).parent.parent / "docs" / "reference" / "logger-lines.md").read_text(
        encoding="utf-8"
    )
    assert [program for program in PROGRAMS if f"| {program} |" not in page] == []


HEAD = "time_ms;pulsation_vacuum_kpa\n"


@pytest.mark.parametrize(
    ("text", "reason", "advice"),
    [
        (
            "time_ms,pulsation_vacuum_kpa\n1000,42,01\n",
            "line 2 has 3 cells, the header 2: decimal commas",
            "semicol",
        ),
        (
            "# a\n\ntime_ms,pulsation_vacuum_kpa\n1,2\n1,2,5\n",
            "line 5 has 3 cells, the header 2",
            "semicolons",
        ),
        (
            "time_ms,pulsation_vacuum_kpa,liner_vacuum_kpa\n1000,42,01\n",
            "'01': decimal commas between commas",
            "semicolons",
        ),
        (
            "time_ms,pulsation_vacuum_kpa,\n1000,42,01\n",
            "line 2 has 3 cells, the header 2: decimal",
            "semicolons",
        ),
        (
            "time_ms,pulsation_vacuum_kpa\n7,1000,42.01\n",
            "line 2 has 3 cells, the header 2: which",
            "name every",
        ),
        (f"{HEAD}1000\n", "line 2 has 1 cell, the header 2", "as many cells"),
        (
            f"{HEAD}1000;42;7\n",
            "line 2 has 3 cells, the header 2: which of them has no name",
            "name every column",
        ),
        (f"{HEAD}1;1000;42\n3;1010;42\n", "line 3 begins with '3', its number would be 2", "line"),
        (f'{HEAD}"a";1000;42\n1010;42\n', "line 3 has 2 cells, the header 2", "as many cells"),
        (f"{HEAD}1,000;42.01\n", "both '1,000' and '42.01'", "none for thousands"),
        (f"{HEAD}1.000,5;42,01\n", "both|not a number", ""),
        (
            f"{HEAD}1,000;42\n1,010;43\n",
            "'1,000', which may be a decimal number or over a thousand",
            "thousands",
        ),
        ('time_ms,pulsation_vacuum_kpa\n"1,000",42\n', "'1,000', which may be a decimal", "thousands"),
        (f"{HEAD}1 000;42,1\n", "line 2: time_ms is '1 000', not a number", "line"),
        (f"{HEAD}1'000;42,1\n", 'line 2: time_ms is "1\'000", not a number', "line"),
        (f"{HEAD}1_000;42,1\n", "line 2: time_ms is '1_000', not a number", "line"),
        (f"{HEAD}1000;NA\n", "line 2: pulsation_vacuum_kpa is 'NA', not a number", "line"),
        (f"{HEAD}1000;kPa\n", "line 2: pulsation_vacuum_kpa is 'kPa', not a number", "line"),
        (f"{HEAD}1000;\n", "line 2: pulsation_vacuum_kpa is '', not a number", "line"),
        (f"{HEAD}min;kPa\n10;42\n", "time_ms is in ms, by the line below in min", "line of units"),
        (
            f"{HEAD}ms;furlong\n",
            "the unit 'furlong' below the column pulsation_vacuum_kpa is not known",
            "units",
        ),
        (
            f"{HEAD}ms;mbar\n1000;420\n",
            "pulsation_vacuum_kpa is in kPa, by the line below in mbar",
            "line of units",
        ),
        (f'{HEAD}1000;"42\n', "line 2 is not CSV", "line"),
        (f'{HEAD}1000;"42"1\n', "line 2 is not CSV", "line"),
        (f"sep=:\n{HEAD}1000;42\n", "line 1 names the separator ':'", "semicolons"),
        ("time_ms;time_ms;pulsation_vacuum_kpa\n1;1;2\n", "both columns time_ms and time_ms", "keep one"),
    ],
)
def test_what_cannot_be_read_is_refused_for_its_own_reason(text, reason, advice):
    with pytest.raises(TableError, match=reason) as caught:
        read(text)
    assert advice in caught.value.hint


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has no column x: it is empty"),
        ("t;p\n1;2\n", "has no column x: line 1 names t, p"),
        ("Logger, barn\n\nt;Pressure [mbar]\n1;2\n", "has no column x: line 3 names t, pressure_mbar"),
        ("1000;42\n1010;43\n", "has no column x: no line names its columns, line 1 is 1000, 42"),
        ("time;kPa\n1;2\n", "has no column x: line 1 names time, kpa"),
    ],
)
def test_a_missing_column_is_told_beside_those_that_are_there(text, says):
    assert Table(text, TIME_AND_VACUUM).missing("x") == says


def test_columns_are_read_by_their_keys_with_the_lines_of_their_rows():
    cells = keyed_cells("a, b_px\n1,\n\n1,2, ,\n", ("b_px",), ("c",), hint="")
    assert (list(cells.lines), cells.columns) == ([2, 4], {"b_px": ["", "2"]})
    with pytest.raises(TableError, match="line 3 has 3 cells, the header 2: decimal commas"):
        keyed_cells("a, b\n1,2\n1,2,3\n", ("b",), hint="")
    with pytest.raises(TableError, match="it has no column c, d: line 1 names a, b") as refused:
        keyed_cells("a, b\n", ("c", "b", "d"), hint="name them")
    assert refused.value.hint == "name them"


def test_rows_that_count_are_names_only_where_that_cannot_be_mistaken():
    """A table whose last column has no head looks the same."""
    with pytest.raises(TableError, match="line 2 has 3 cells, the header 2: which of them has no name"):
        read("time_ms pulsation_vacuum_kpa\n" + rows("{n} {ms} {kpa}"), may_count=False)


@pytest.mark.parametrize("first", ["12,5", "0,125", "1000", "1,250"])
def test_commas_are_decimal_where_one_number_shows_it(first):
    others = "{ms};{kpa}" if first != "1,250" else "{s};{kpa}"
    _, vacuum = read(f"{HEAD}{first};42,125\n" + rows(others, ","))
    assert vacuum[1:] == KPA


def test_a_head_may_have_a_line_break_in_quotes_and_rows_too():
    text = 'note;"time\n[ms]";pulsation_vacuum_kpa\n"two\nlines";1000;42\n'
    assert read(text) == ([1000.0], [42.0])
    with pytest.raises(TableError, match="line 5: pulsation_vacuum_kpa is 'x'"):
        read(f"{text}b;1010;x\n")


@pytest.mark.parametrize(
    ("cell", "column", "key"),
    [
        ("time_ms", ("time_ms", "ms"), "time_ms"),
        ("Time (s)", ("Time", "s"), "time_s"),
        (" Pulsation  vacuum [KPA] ", ("Pulsation vacuum", "kPa"), "pulsation_vacuum_kpa"),
        ("x_mm", ("x_mm", "mm"), "x_mm"),
        ("x [mm]", ("x", "mm"), "x_mm"),
        ("y_step", ("y_step", None), "y_step"),
        ("Temp [°C]", ("Temp", "°C"), "temp_°c"),
        ("", ("", None), ""),
    ],
)
def test_a_head_has_a_name_a_unit_and_a_key(cell, column, key):
    assert (Column.of(cell), Column.of(cell).key) == (Column(*column), key)


def test_rows_and_columns_are_limited():
    with pytest.raises(TableError, match=f"more than {MOST_ROWS} rows"):
        read(HEAD + "1;2\n" * (MOST_ROWS + 1))
    with pytest.raises(TableError, match="line 2 has more than 1000 columns"):
        read(f"{HEAD}1" + ";" * 1000)
    with pytest.raises(TableError, match="line 2 is not CSV"):
        read(f'{HEAD}"' + "a" * 200_000)


@given(st.text(alphabet='tim_s;,\t| "#\n\r1.=[]', max_size=120))
def test_whatever_stands_before_a_header_its_rows_fit_it_or_are_refused(text):
    try:
        table = Table(f"{text}\n{HEAD}1;2\n", TIME_AND_VACUUM, may_count=True)
        lengths = {len(row) for _, row in table.rows()}
    except TableError:
        return
    assert lengths <= {len(table.columns)}


@pytest.mark.parametrize("cell", ["1e31", "-1e308", "1e999"])
def test_a_number_that_cannot_be_reckoned_with_is_none(cell: str) -> None:
    assert number_of(cell) is None
    assert number_of("1e30") == 1e30
