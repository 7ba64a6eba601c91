"""Negotiation of an interlaced stream: standard, pixel format and field order, each read back after it is
set.
"""

import errno
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

from grabberd.errors import DeviceRefused
from grabberd_v4l2 import abi, standards
from grabberd_v4l2.abi import ONE_FIELD, Arrangement
from grabberd_v4l2.formats import RAW
from grabberd_v4l2.modes import is_near
from grabberd_v4l2.node import Node
from grabberd_v4l2.options import V4l2Options
from grabberd_v4l2.profiles import Profile
from grabberd_v4l2.standards import DEFAULT, SCAN_525, SCAN_625, Scan

COLUMNS = 720
# Only lines have to be whole: cards that sample square pixels (768 columns) or fewer ones are usable.
FEWEST_COLUMNS, MOST_COLUMNS = 640, 1024


def set_up(node: Node, options: V4l2Options, profile: Profile) -> tuple[abi.PixFormat, Scan, str]:
    """Sets standard and format.

    Returns:
        The granted format, what a camera of the granted standard scans, and the standard's name.

    Raises:
        DeviceRefused: the card has no such standard, or grants no usable stream.
        OSError: a call failed.
    """
    standard, scan = _set_standard(node, options)
    return _set_format(node, _Wanted.of(node, options, profile, scan)), scan, standard


def _set_standard(node: Node, options: V4l2Options) -> tuple[str, Scan]:
    """The standard in force, and what its cameras scan."""
    name = options.standard or DEFAULT
    wanted, offered = standards.bits(name), node.standards()
    if not any(one.id & wanted for one in offered):
        raise _no_such_standard(node, name, offered)
    # Always, whatever it is at now: stk1160 and usbtv start up in NTSC.
    node.set_standard(wanted)
    granted, scan = node.standard(), standards.scan(wanted)
    assert scan is not None, "every standard that has a name has a scan"
    if standards.scan(granted) != scan:
        other = standards.scan(granted)
        raise DeviceRefused(
            f"{node.path} was set to {name} but is at {standards.name(granted)}"
            + (f" ({other})" if other else ""),
            f"the card does not run at {scan}; use another grabber",
        )
    return standards.name(granted), scan


def _no_such_standard(node: Node, name: str, offered: Sequence[abi.Standard]) -> DeviceRefused:
    names = ", ".join(one.name.decode("ascii", "replace") for one in offered) or "none at all"
    hint = "choose a composite or S-Video input (option 'input') or another grabber"
    known = dict.fromkeys(filter(None, (standards.scan(one.id) for one in offered)))
    if known:
        families = " or ".join(standards.family(scan) for scan in known)
        hint = f"with a camera of another standard set the option 'standard: {families}'; else {hint}"
    elif not offered:
        hint = f"{hint}; a camera without standards needs neither 'standard' nor 'field_order'"
    return DeviceRefused(f"{node.path} has no {name} at this input; its standards: {names}", hint)


class _Wanted(NamedTuple):
    """An interlaced stream to be requested: columns, formats and field orders, the preferred first."""

    scan: Scan
    columns: int
    exact: bool
    formats: Sequence[str]
    orders: Sequence[int]
    own_order: bool
    none_is_woven: bool

    @classmethod
    def of(cls, node: Node, options: V4l2Options, profile: Profile, scan: Scan) -> "_Wanted":
        _check_kept_to(node, options, scan)
        size = options.columns_lines
        orders = profile.field_orders if options.arrangement is None else (options.arrangement,)
        return cls(
            scan=scan,
            columns=COLUMNS if size is None else size[0],
            exact=size is not None,
            formats=_common_formats(node, [one for one in options.format if one in RAW]),
            orders=orders,
            own_order=options.arrangement is not None,
            none_is_woven=profile.none_is_woven,
        )

    def lines(self, order: int) -> int:
        return self.scan.lines // 2 if order in ONE_FIELD else self.scan.lines

    def is_our_size(self, answer: abi.PixFormat) -> bool:
        fits = answer.width == self.columns if self.exact else FEWEST_COLUMNS <= answer.width <= MOST_COLUMNS
        return bool(answer.height == self.lines(answer.field) and fits)

    def is_of_use(self, answer: abi.PixFormat) -> bool:
        fourcc, order = _format_of(answer)
        fields = [a for a in Arrangement if a is not Arrangement.ANY]
        if not self.none_is_woven:
            fields.remove(Arrangement.NONE)
        return fourcc in self.formats and order in fields and self.is_our_size(answer)


def _check_kept_to(node: Node, options: V4l2Options, scan: Scan) -> None:
    """Checks that size and rate, if they are asked for, are those of the standard.

    Raises:
        DeviceRefused: they are not.
    """
    family = standards.family(scan)
    others = " or ".join(
        f"'standard: {standards.family(one)}' has {one.lines} lines at {one.rate_hz:.4g} fields a second"
        for one in (SCAN_625, SCAN_525)
    )
    size = options.columns_lines
    if size is not None and size[1] != scan.lines:
        what = f"a frame of {family} has {scan.lines} lines, not {size[1]}"
        raise DeviceRefused(f"{node.path}: {what}", f"correct the option 'size': {others}")
    if options.rate_hz is not None and not is_near(options.rate_hz, scan.rate_hz):
        what = f"{family} has {scan.rate_hz:.4g} fields a second, not {options.rate_hz:g}"
        raise DeviceRefused(f"{node.path}: {what}", f"leave out the option 'rate_hz': {others}")


def _set_format(node: Node, wanted: _Wanted) -> abi.PixFormat:
    """First request that is granted exactly, or else the first usable answer."""
    # Never FIELD_ANY: with it several drivers silently deliver one field at half height.
    answers = []
    for order, fourcc in product(wanted.orders, wanted.formats):
        answer = _granted(node, wanted.columns, wanted.lines(order), fourcc, order)
        if answer is not None and wanted.is_our_size(answer) and _format_of(answer) == (fourcc, order):
            return answer
        answers.append(answer)
    # Later requests have changed the card's state: a usable answer has to be requested once more.
    if not wanted.own_order:
        for answer in filter(None, answers):
            if wanted.is_of_use(answer) and _is_granted_again(node, answer, wanted):
                return answer
    raise _nothing_granted(node, wanted, [answer for answer in answers if answer is not None])


def _common_formats(node: Node, wanted: Sequence[str]) -> Sequence[str]:
    offered = node.pixel_formats()
    common = [fourcc for fourcc in wanted if fourcc in offered]
    if not common:
        raise DeviceRefused(
            f"{node.path} delivers {', '.join(offered) or 'no format at all'}, none of "
            f"{', '.join(wanted or RAW)}",
            f"option 'format' allows {', '.join(RAW)} for fields; a card with none of them cannot be used",
        )
    return common


def _granted(node: Node, columns: int, lines: int, fourcc: str, order: int) -> abi.PixFormat | None:
    """Format that the card offers for a requested one; None if it refuses."""
    try:
        node.set_format(columns, lines, fourcc, order)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        return None
    return node.format()


def _is_granted_again(node: Node, answer: abi.PixFormat, wanted: _Wanted) -> bool:
    again = _granted(node, wanted.columns, answer.height, *_format_of(answer))
    return again is not None and _format_of(again) == _format_of(answer) and wanted.is_our_size(again)


def _format_of(answer: abi.PixFormat) -> tuple[str, int]:
    return abi.fourcc_name(answer.pixelformat), int(answer.field)


def _nothing_granted(node: Node, wanted: _Wanted, answers: Sequence[abi.PixFormat]) -> DeviceRefused:
    requested = ", ".join(_order_name(order) for order in wanted.orders)
    got = "; ".join(dict.fromkeys(map(_in_words, answers))) or "none of them"
    lines = wanted.scan.lines
    return DeviceRefused(
        f"{node.path}: requested {wanted.columns}×{lines} (a field: {lines // 2}) in field order "
        f"{requested}, format {', '.join(wanted.formats)}; it grants {got}",
        "remove the options 'size', 'field_order' and 'format'; if that does not help, this card cannot "
        f"deliver whole {standards.family(wanted.scan)} fields",
    )


def _in_words(answer: abi.PixFormat) -> str:
    fourcc, order = _format_of(answer)
    return f"{answer.width}×{answer.height} {fourcc} {_order_name(order)}"


def _order_name(order: int) -> str:
    return Arrangement(order).name if order in list(Arrangement) else f"field {order}"
