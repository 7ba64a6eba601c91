"""Check of the field order: do fields follow one another in time as delivered, judged by a moving object?

Where discs are seen, their paths tell; elsewhere, as before a moved hand, the differences of the pictures.
"""

from collections.abc import Iterable

from grabberd.core.chain.disc_paths import LEAST_FIELDS, DiscMovement, DiscPaths, Share
from grabberd.core.chain.picture_differences import FieldOrderFinding, PictureDifferences, Ratio
from grabberd.core.field import Field
from grabberd.core.reconstruction.field_order import Order

_LEAST_FIELDS = 60
_OF_DISCS = 0.5
"""Share of the fields that show discs, from which on these are what counts."""
_NO_ZIGZAG, _STEADY_NO_ZIGZAG = 0.18, 0.15
"""Zigzag of a right order, of all movement and of steady one. Both fields of one instant have 0.25."""
_LIKE_ONE_INSTANT = (0.17, 0.33)
_BACK_AND_FORTH = 0.45
"""Zigzag that no movement in the right order has."""


class OrderCheck:
    """Check of the order of fields as delivered. Nothing of a field is kept but its discs and differences."""

    def __init__(self) -> None:
        self._paths, self._differences = DiscPaths(), PictureDifferences()
        self._fields = self._following = 0
        self._parity: int | None = None
        self.offset_px: float | None = None
        """With the finding: frame lines by which discs lie lower in top fields than in bottom ones, 0 unless
        the parities have the wrong names; None if no discs show it."""

    def add(self, field: Field | None) -> None:
        """Take the next field; None for a gap of unknown length. Two of one parity in a row are one, too."""
        if field is None:
            self._paths.interrupt()
            self._differences.interrupt()
            self._parity = None
            return
        self._fields += 1
        self._following += self._parity is not None and field.parity != self._parity
        self._parity = field.parity
        self._paths.add(field)
        self._differences.add(field)

    def finding(self) -> FieldOrderFinding:
        """Finding of the fields so far; a verdict only if it is significant (3 σ)."""
        count, movement = self._fields, self._paths.movement()
        self.offset_px = movement.offset_px
        if self._following + 1 < _LEAST_FIELDS:
            evidence = f"{count} fields, too few of alternating parity: {_LEAST_FIELDS} are needed"
            return FieldOrderFinding(Order.UNCLEAR, evidence, count)
        if movement.fields < _OF_DISCS * count:
            return self._differences.finding()
        order = _order(movement)
        ratios = _squared(movement.from_top), _squared(movement.from_bottom)
        return FieldOrderFinding(order, _evidence(order, movement, ratios), count, *ratios)


def check(fields: Iterable[Field | None]) -> FieldOrderFinding:
    """Checks the order of fields as delivered, on a few seconds of an object that moves.

    Nothing of a field is kept, so a driver may write over it when the next is requested. None is a gap.
    """
    order = OrderCheck()
    for field in fields:
        order.add(field)
    return order.finding()


def _order(movement: DiscMovement) -> Order:
    if movement.zigzag.fields < LEAST_FIELDS and not movement.is_always_steady:
        return Order.NO_MOVEMENT
    zigzag, steady = movement.zigzag, movement.steady
    if zigzag.is_above(_BACK_AND_FORTH):
        return Order.REVERSED
    is_steadily_right = steady.is_below(_STEADY_NO_ZIGZAG) and zigzag.is_below(_BACK_AND_FORTH)
    if zigzag.is_below(_NO_ZIGZAG) or is_steadily_right:
        return Order.RIGHT
    least, most = _LIKE_ONE_INSTANT
    alike = steady.is_above(least) and steady.is_below(most) and least < zigzag.value < _BACK_AND_FORTH
    return Order.SAME_INSTANT if alike else Order.UNCLEAR


def _squared(step: Share) -> Ratio | None:
    """Steps of one field, squared, by the share of a step in the movement over two."""
    if step.fields < LEAST_FIELDS:
        return None
    length = 2 * step.value
    return Ratio(length**2, 2 * abs(length) * 2 * step.sigma)


_MEANING = {
    Order.RIGHT: "each field follows the one before (1 and 1, farther apart in sudden movement)",
    Order.REVERSED: "the fields of a frame change places (1 and 9)",
    Order.SAME_INSTANT: "both fields of a frame are of one instant (0 and 4)",
}


def _evidence(order: Order, movement: DiscMovement, ratios: tuple[Ratio | None, Ratio | None]) -> str:
    if order is Order.NO_MOVEMENT:
        seldom = f"discs move in only {movement.zigzag.fields} of {movement.fields} fields"
        still = seldom if movement.zigzag.fields else "no disc moves clearly from one field to the next"
        return f"too little movement: {still}"
    if order is Order.UNCLEAR:
        return _why_unclear(movement)
    zigzag = f"in {movement.zigzag.fields} fields the paths of discs zigzag by {movement.zigzag.value:.2f}"
    if None in ratios:
        return f"{zigzag} of the movement over two fields, squared: {_MEANING[order]}"
    return (
        f"top to bottom {ratios[0]}, bottom to top {ratios[1]} of one field step squared, and {zigzag} "
        f"of that over two: {_MEANING[order]}"
    )


def _why_unclear(movement: DiscMovement) -> str:
    if movement.is_always_steady:
        return "the movement is too steady: move the object, pause, and move it again"
    zigzag = Ratio(movement.zigzag.value, movement.zigzag.sigma)
    return (
        f"the paths of discs zigzag by {zigzag} of the movement over two fields, squared: not clearly 0 "
        "(right), 0.25 (both fields of one instant) or 1 (reversed): move it more slowly, or for longer"
    )
