"""The tables of a study and their columns: name, unit, type and meaning."""

from collections.abc import Iterable, Sequence

from grabberd.core.chain.columns import Column, TableSpec


def _measured(name: str, unit: str, meaning: str) -> Column:
    return Column(name, unit, "f8", meaning, measured=True)


def _number(name: str, unit: str, meaning: str) -> Column:
    return Column(name, unit, "f8", meaning)


def _text(name: str, meaning: str) -> Column:
    return Column(name, "", "U", meaning)


_QUANTITY = (
    _text("quantity", "name of the quantity, ending with its unit if it has one"),
    _text("unit", "unit of the row's values; 1 for a ratio"),
)
_BASIS = _text(
    "basis",
    "what σ is based on, besides its common part: scatter of the captures; own σ, if that is greater; own σ "
    "alone, if there is no scatter to judge by, so that nothing can be tested",
)


def _judged(name: str, meaning: str, what: str) -> tuple[Column, ...]:
    """A value with σ and the common part of that, and what judges it."""
    return (
        _measured(name, "", meaning),
        _number(f"sigma_common_{name}", "", f"part of sigma_{name} that more captures do not reduce"),
        _number("low", "", f"lower end of the 95 % interval of the {what}"),
        _number("high", "", f"upper end of the 95 % interval of the {what}"),
        _number("dof", "", "degrees of freedom of σ (Welch–Satterthwaite); empty without scatter"),
    )


_TEST = (
    _number("t", "1", "value by its σ"),
    _number("p", "1", "probability of a value at least as far from 0 if it were 0"),
)

TABLES = {
    "quantities": TableSpec(
        "Quantities compared: a row for each",
        _QUANTITY,
        (
            _text("title", "what it is called"),
            _text("definition", "its definition"),
            _number("captures", "", "captures that have it"),
            _text("paired", "yes if groups were compared within the blocks, else no"),
            _number("between_sigma", "", "standard deviation between the blocks, beyond that within them"),
            _number("within_sigma", "", "standard deviation of the replicates within groups and blocks"),
            _number("chi2", "1", "sum of the captures' squared deviations, weighted by their own σ"),
            _number("chi2_dof", "", "its expected value if captures differ by their own σ alone"),
            _number("chi2_p", "1", "probability of a greater one if they do"),
            _text("verdict", "differ if any pair of groups does, else no difference shown; or not tested"),
            _text("remarks", "remarks"),
        ),
    ),
    "groups": TableSpec(
        "The groups: a row for each quantity and group",
        (*_QUANTITY, _text("group", "name of the group")),
        (
            _number("captures", "", "captures of the group that have the quantity"),
            _number("replicates", "", "number of independent values after averaging by unit"),
            *_judged("mean", "mean of the group", "mean"),
            _BASIS,
        ),
    ),
    "comparison": TableSpec(
        "Comparison of groups: a row for each quantity and pair",
        (
            *_QUANTITY,
            _text("first", "name of a group"),
            _text("second", "name of another group"),
        ),
        (
            *_judged("difference", "mean of `second` minus that of `first`", "difference"),
            *_TEST,
            _number("adjusted_p", "1", "p adjusted for all pairs of the quantity (Holm)"),
            _BASIS,
            _text("verdict", "differ if adjusted_p < .05, else no difference shown; or not tested"),
        ),
    ),
    "trend": TableSpec(
        "The trend: a row for each quantity and group, and one for the slope that all groups share",
        (
            *_QUANTITY,
            _text("group", "name of the group; empty for the slope that all share"),
            _text("over", "what the trend runs over"),
        ),
        (
            *_judged("slope", "change of the quantity per unit of `over`", "slope"),
            *_TEST,
            _BASIS,
            _text("verdict", "changes if p < .05, else no change shown; or not tested"),
        ),
    ),
    "left_out": TableSpec(
        "Omissions: a row for each capture, or quantity of a capture, that was left out",
        (
            _text("capture", "id of the capture, or the file"),
            _text("quantity", "name of the quantity; empty where the whole capture is left out"),
        ),
        (_text("reason", "why"),),
    ),
}


def captures_spec(labels: Iterable[str], quantities: Sequence[tuple[str, str, str]]) -> TableSpec:
    """Specification of the table `captures`.

    Args:
        labels: keys of labels.
        quantities: name, unit and title of each.
    """
    return TableSpec(
        "The captures: a row for each",
        (_text("capture", "id of the capture"),),
        (
            _text("captured_utc", "its start"),
            _text("device", "name of its device"),
            _text("verdict", "complete or incomplete"),
            _text("group", "name of its group"),
            _text("analysis", "number of its newest analysis, or the folder that it is in"),
            _text("analysed_utc", "when that was made"),
            _text("liner_shared", "the liner: captures of the same one share the common part of σ"),
            *(_text(f"label_{name}", f"its label {name}") for name in labels),
            *(column for one in quantities for column in _quantity(*one)),
        ),
    )


def _quantity(name: str, unit: str, title: str) -> tuple[Column, Column]:
    common = _number(f"sigma_common_{name}", unit, f"part of sigma_{name} that captures of a liner share")
    return _measured(name, unit, title), common
