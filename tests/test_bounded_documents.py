"""Documents from outside are bounded, whatever they claim and repeat."""

import json
import pickle
import re
import tracemalloc
from pathlib import Path

import pytest
import yaml

from grabberd.archive.input_files import read_identifications, read_truth
from grabberd.bounded_documents import (
    as_written,
    decoded,
    parse_yaml,
    read_bounded,
    read_text,
    yaml_text,
)
from grabberd.config.reading import load_config
from grabberd.errors import ConfigError, InputError
from grabberd.files.reading import read_documents, read_yaml

LAUGHS = "a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 9)
)
MERGES = "a0: &a0 {x: 1, y: 2}\n" + "".join(
    f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 9)}]}}\n" for n in range(1, 12)
)
DEEP = "[" * 100_000
TEXTS = ["4:00", "1:30.5", "NO", "yes", "on", "off", "y", "1_000", "0b11", "2026-11-28", "0o8", "1e", "~x"]
"""Numbers, truth values and dates to YAML 1.1 or to nobody."""


@pytest.mark.parametrize("fast", [False, True])
def test_a_document_that_repeats_parts_of_itself_is_read_as_it_says(fast):
    text = "targets: [&t {x: 1}, *t]\nother: {<<: *t, y: [2.5, null, ha]}"
    assert parse_yaml(text, fast=fast) == {
        "targets": [{"x": 1}, {"x": 1}],
        "other": {"x": 1, "y": [2.5, None, "ha"]},
    }


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LAUGHS, "more than 1000000 parts"),
        (MERGES, "more than 1000000 parts"),
        (DEEP, "nested in more than 40 levels"),
        ("a: " * 50 + "1", "not valid YAML"),
        ("&a [*a]", "'a' contains itself"),
        ("[*a]", "'a' contains itself, or is not there|undefined alias"),
        ("1" * 5000, "4300 digits"),
        ("!!timestamp 2026-99-99", "month"),
        ("{a: 1, b: {c: 1, d: 2, c: 3}}", "the key 'c' is given twice"),
        ("!!int x", "invalid literal"),
        ("!!timestamp x", "not valid YAML"),
        ("!!python/object/apply:os.system [ls]", "not valid YAML"),
        ("{[a]: 1}", "not valid YAML"),
        ("a: \x01", "not valid YAML"),
        ("a" * ((16 << 20) + 1), "more than 16777216 characters"),
    ],
)
def test_what_would_take_memory_or_end_the_program_is_an_error_of_the_document(text, message, fast):
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=message):
            parse_yaml(text, fast=fast)
        assert tracemalloc.get_traced_memory()[1] < 150 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize(
    ("words", "value"),
    [
        *(("011", 11), ("018", 18), ("-07", -7), ("+7", 7), ("0o17", 15), ("0x1F", 31), ("0240", 240)),
        *(
            (".5", 0.5),
            ("1e5", 1e5),
            ("-1.5e-3", -1.5e-3),
            ("1.", 1.0),
            (".inf", float("inf")),
            ("-.INF", -float("inf")),
        ),
        *(("true", True), ("False", False), ("~", None), ("null", None), ("", None)),
        *(
            (one, one)
            for one in (
                "4:00",
                "1:30.5",
                "NO",
                "yes",
                "on",
                "off",
                "y",
                "1_000",
                "0b11",
                "2026-11-28",
                "0o8",
                "1e",
                "~x",
            )
        ),
        ("'011'", "011"),
        ("!!int '011'", 11),
    ],
)
def test_words_mean_what_the_core_schema_of_yaml_1_2_says(words, value, fast):
    assert parse_yaml(f"key: {words}", fast=fast) == {"key": value}


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize(
    ("word", "told"),
    [
        *((one, "for a truth value write true") for one in ("yes", "on", "On", "y")),
        *((one, "for a truth value write false") for one in ("NO", "off", "n")),
        *((one, "for a number write 240") for one in ("4:00", "2_40", "0b11110000", "0xF_0")),
        *((one, "for a number write 90.5") for one in ("1:30.5", "9_0.5")),
    ],
)
def test_a_word_that_was_something_else_to_yaml_1_1_says_where_it_stands_and_what_to_write(word, told, fast):
    found = parse_yaml(f"a: 1\nkey: [{word}]", fast=fast)["key"][0]
    assert found == word
    assert repr(found) == f"{word!r} (line 2, column 7: a text in YAML 1.2; {told})"
    assert repr(parse_yaml(word, fast=fast)) == f"{word!r} (a text in YAML 1.2; {told})"


@pytest.mark.parametrize("fast", [False, True])
def test_other_texts_and_quoted_words_are_nothing_but_texts(fast):
    words = parse_yaml("[yesterday, 'yes', \"4:00\", 0x_, 1.2.3, 2026-11-28, 'on']", fast=fast)
    assert {type(word) for word in words} == {str}


def test_a_word_is_an_ordinary_text_for_all_other_programs():
    found = parse_yaml("a: 1\nkey: yes")
    assert json.dumps(found) == '{"a": 1, "key": "yes"}'
    assert {type(word) for word in pickle.loads(pickle.dumps(found)).values()} == {int, str}
    assert parse_yaml(yaml_text(found)) == yaml.safe_load(yaml_text(found)) == found


@pytest.mark.parametrize(
    ("text", "read", "said"),
    [
        (
            "key: yes",
            lambda document: {"key": True},
            "key: 'yes' (line 1, column 6: a text in YAML 1.2; for a ",
        ),
        (
            "key: {b: [0, 1_0]}",
            lambda document: {"key": {"b": (0, 10)}},
            "key.b[1]: '1_0' (line 1, column 14: a",
        ),
    ],
)
def test_a_reader_that_takes_a_word_for_a_number_or_truth_value_is_stopped(text, read, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        as_written(parse_yaml(text), read)
    assert as_written(parse_yaml(text), dict) == parse_yaml(text)


@pytest.mark.parametrize(
    "text", ["011", "0o17", "1e5", "yes", "4:00", "2026-11-28", ".5", "~", "", "1_0", "Ø", "a: b"]
)
def test_a_text_stays_one_for_every_reader(text):
    written = yaml_text({"key": text})
    assert parse_yaml(written) == yaml.safe_load(written) == {"key": text}


def test_a_file_that_goes_on_for_ever_is_read_up_to_the_limit():
    with pytest.raises(ValueError, match="more than 1000 bytes"):
        read_bounded(Path("/dev/zero"), 1000)


def test_exactly_the_limit_is_read(tmp_path):
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfabc")
    assert read_text(tmp_path / "a", 6) == "abc"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_text_says_by_its_byte_order_mark_how_it_is_encoded(tmp_path, encoding):
    (tmp_path / "a").write_text("µs\n", encoding=encoding)
    assert read_text(tmp_path / "a") == "µs\n"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK\x03\x04\x14\0\x06\0", "it is a spreadsheet's own file, not a text: save it as CSV UTF-8"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1", "it is a spreadsheet's own file, not a text: save it as CSV UTF-8"),
        ("time\nµs".encode("cp1252"), "line 2 has the byte 0xB5, which is not UTF-8: save it as UTF-8"),
        ("time".encode("utf-16-le"), "zero characters, as UTF-16 has without its byte order mark"),
        (b"\xff\xfet\0i", "not UTF-16-LE"),
    ],
)
def test_a_text_that_does_not_say_so_is_refused(content, message):
    with pytest.raises(ValueError, match=message):
        decoded(content)


@pytest.mark.parametrize("text", [LAUGHS, MERGES, DEEP, "1" * 5000, "a: !!timestamp 2026-99-99", "\udcff"])
def test_every_reader_of_a_document_tells_it_as_a_fault_of_the_file(tmp_path, text):
    file = tmp_path / "hostile"
    file.write_text(text, errors="surrogateescape")
    with pytest.raises(ConfigError, match="hostile"):
        load_config(file)
    for read in (
        read_yaml,
        lambda path: read_documents(path, None),
        lambda path: read_documents(None, path),
        read_truth,
        read_identifications,
    ):
        with pytest.raises(InputError, match="hostile"):
            read(file)


def test_no_reader_follows_a_file_that_never_ends():
    for read in (load_config, read_yaml, read_truth):
        with pytest.raises((InputError, ConfigError), match=r"(?s)/dev/zero.*more than"):
            read(Path("/dev/zero"))


def test_a_mapping_of_many_keys_is_checked_in_a_moment(tmp_path):
    file = tmp_path / "many.yaml"
    file.write_text("".join(f"k{n}: 1\n" for n in range(20_000)) + "k7: 2\n")
    with pytest.raises(ConfigError, match="'k7' is given twice"):
        load_config(file)
