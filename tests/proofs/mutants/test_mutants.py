"""Mutants are what their operators say, and are found again wherever their functions went."""

import ast
import marshal
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.proofs.mutants.choosing import HOUSES, chosen
from tests.proofs.mutants.functions import Catalogue, digest, named
from tests.proofs.mutants.mutant import Mutant, Outcome, read, write
from tests.proofs.mutants.mutated import mutated_tree
from tests.proofs.mutants.nearest import doors
from tests.proofs.mutants.operators import OPERATORS, changes

BODIES = [
    ("border", "return a < b", ["return a <= b"]),
    ("border", "return a == b != c", ["return a != b != c", "return a == b == c"]),
    ("negated", "return a if b else c", ["return a if not b else c"]),
    ("negated", "return not a", ["return a"]),
    ("negated", "f(True)", ["f(False)"]),
    ("negated", "while a:\n    pass", []),
    ("and/or", "return a and b", ["return a or b"]),
    ("arithmetic", "return a + b * c", ["return a - b * c", "return a + b / c"]),
    ("arithmetic", "a += b", ["a -= b"]),
    ("arithmetic", "return folder / 'name'", []),
    ("constant", "return 2", ["return 3", "return -2"]),
    ("constant", "return 0.5", ["return -0.5"]),
    ("index", "return a[0]", ["return a[1]"]),
    ("index", "return a[-1]", ["return a[-2]"]),
    ("index", "return a[1:]", ["return a[2:]"]),
    ("return None", "return a", ["return None"]),
    ("return None", "return", []),
    ("deleted", "f(a)", ["pass"]),
    ("deleted", "a += 1", ["pass"]),
    ("deleted", "log.warning(a)", []),
    ("deleted", "'a docstring'", []),
    ("min/max", "return max(a, b)", ["return min(a, b)"]),
    (
        "min/max",
        "return np.minimum(a, b).max()",
        ["return np.minimum(a, b).min()", "return np.maximum(a, b).max()"],
    ),
    ("continue/break", "for a in b:\n    continue", ["for a in b:\n    break"]),
    ("constant", "raise Error('text', 1 + 1)", []),
    ("constant", "return Error(hint=1)", []),
    ("constant", "a: Literal[1] = b", []),
]
SOURCE = '''
class Ring:
    """Fields."""

    def is_full(self, more: int = 0) -> bool:
        """True if no field fits in."""
        from grabberd.field import SIZE

        return len(self.fields) + more >= SIZE

def _size(ring): return 1
def size(ring): return _size(ring)
'''
MOVED = SOURCE.replace('"""True if no field fits in."""', "# Full.").replace("grabberd.field", "videometry")
FULLNESS = "len(self.fields) + more >= SIZE"


@pytest.mark.parametrize(("operator", "body", "expected"), BODIES)
def test_an_operator_changes_what_it_says(operator: str, body: str, expected: list[str]) -> None:
    assert list(of(operator, body)) == expected


def of(operator: str, body: str) -> Iterator[str]:
    text = "def f(a=1) -> None:\n" + "\n".join(f"    {line}" for line in body.splitlines())
    places = [one.place for one in changes(named(ast.parse(text), "f")) if one.operator == operator]
    for place in places:
        changed = mutated_tree(text, Mutant("core", "f", "", operator, place, "")).body[0]
        yield "\n".join(ast.unparse(one) for one in changed.body)  # type: ignore[attr-defined]


def test_every_operator_is_tried() -> None:
    assert {operator for operator, _, _ in BODIES} == set(OPERATORS)


def catalogue(**texts: str) -> Catalogue:
    return Catalogue({name: ast.parse(text) for name, text in texts.items()})


def mutant() -> Mutant:
    known = digest(named(ast.parse(SOURCE), "Ring.is_full"))
    return Mutant("core", "Ring.is_full", known, "border", 0, "")


def test_a_mutant_is_found_again_after_its_function_moved() -> None:
    now = catalogue(other="x = 1", videometry_buffers=f"import numpy\n{MOVED}")
    found = now.found("Ring.is_full", mutant().digest)
    assert [one.module for one in found] == ["videometry_buffers"]
    assert FULLNESS.replace(">=", ">") in ast.unparse(mutated_tree(MOVED, mutant()))


@pytest.mark.parametrize("text", [SOURCE.replace("more >=", "more >"), SOURCE.replace("Ring", "Buffer")])
def test_a_changed_or_renamed_function_is_not_found(text: str) -> None:
    assert catalogue(ring=text).found("Ring.is_full", mutant().digest) == []


def test_a_protocol_has_no_functions() -> None:
    declared = catalogue(ring=SOURCE.replace("Ring", "Ring(Protocol)"))
    assert [one.name for one in declared.single()] == ["_size", "size"]


def test_the_same_seed_chooses_the_same_mutants_one_of_a_function() -> None:
    both = catalogue(
        grabberd=SOURCE, grabberd_fake="def one(): return 1 + 2", grabberd_liner="def one(): return 1 + 2"
    )
    mutants = list(chosen(both, seed=1))
    assert mutants == list(chosen(both, seed=1))
    assert sorted(one.function for one in mutants) == ["Ring.is_full", "_size"]


def test_a_private_function_is_reached_through_its_public_users() -> None:
    assert doors(ast.parse(SOURCE), "_size") == {"size"}
    assert doors(ast.parse(SOURCE), "Ring.is_full") == {"Ring"}


def test_outcomes_are_read_as_they_were_written(tmp_path: Path) -> None:
    known = {
        mutant(): Outcome("killed", "tests/test_ring.py::test_full", 1.5),
        mutant()._replace(place=1): Outcome(),
    }
    write(tmp_path / "kept.jsonl", known.items())
    assert read(tmp_path / "kept.jsonl") == known


def test_a_process_that_a_test_starts_has_the_mutant_as_well(tmp_path: Path) -> None:
    (tmp_path / "colorsys").write_bytes(marshal.dumps(compile("ONE_THIRD = 'mutated'", "colorsys", "exec")))
    environment = {"PYTHONPATH": str(Path(__file__).parent / "inherited"), "GRABBERD_MUTANT": str(tmp_path)}
    command = [sys.executable, "-c", "import colorsys; print(colorsys.ONE_THIRD)"]
    run = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True, check=True)
    assert run.stdout == "mutated\n"


def test_the_kept_mutants_are_as_many_for_every_house() -> None:
    houses = [one.house for one in read(Path(__file__).parent / "kept.jsonl")]
    assert {house: houses.count(house) for house in HOUSES} == dict.fromkeys(HOUSES, 200)
