"""Choice of the mutants: by a seed, one per function, spread over the modules of each house."""

import ast
import random
import re
from collections import Counter
from collections.abc import Iterator
from itertools import islice

from tests.house.houses import house_of

from .functions import Catalogue, Function, digest
from .mutant import Mutant
from .operators import RETURNS_NOTHING, Change, changes

HOUSES = ("core", "liner", "instrument")
_WITH = {"ground": "core", "drivers": "instrument", "outlets": "instrument"}
"""Small houses, and those that their mutants are chosen with."""
PER_HOUSE = 200
LEFT_OUT = ("__repr__", "__str__")


def chosen(catalogue: Catalogue, seed: int, count: int = PER_HOUSE) -> Iterator[Mutant]:
    """Mutants of each house: first one of every module, then a second one, until there are enough."""
    single = list(catalogue.single())
    for house in HOUSES:
        rng = random.Random(f"{seed} {house}")
        of_house = [one for one in single if _house(one.module) == house]
        yield from (_mutant(house, one, rng) for one in islice(_spread(of_house, rng), count))


def _house(module: str) -> str:
    house = house_of(module)
    return _WITH.get(house, house)


def _spread(functions: list[Function], rng: random.Random) -> Iterator[Function]:
    """The functions in random order, but none of a module before the others had their turn."""
    turn: Counter[str] = Counter()
    turns = []
    for one in rng.sample(functions, len(functions)):
        if _places(one):
            turn[one.module] += 1
            turns.append((turn[one.module], one))
    yield from (one for _, one in sorted(turns, key=lambda pair: pair[0]))


def _mutant(house: str, function: Function, rng: random.Random) -> Mutant:
    """One change of the function; that it returns nothing only where no other operator has a place."""
    places = _places(function)
    operators = sorted({one.operator for one in places} - {RETURNS_NOTHING}) or [RETURNS_NOTHING]
    operator = rng.choice(operators)
    change = rng.choice([one for one in places if one.operator == operator])
    return Mutant(house, function.name, digest(function.node), operator, change.place, change.text)


def _places(function: Function) -> list[Change]:
    last = function.name.rpartition(".")[2]
    if last in LEFT_OUT or last.startswith("test_"):
        return []
    return [one for one in changes(function.node) if one.operator != RETURNS_NOTHING or _returns(function)]


def _returns(function: Function) -> bool:
    """True if None is no sensible result by the function's annotation."""
    returned = function.node.returns
    return returned is not None and not {"None", "Any", "object"} & set(
        re.findall(r"\w+", ast.unparse(returned))
    )
