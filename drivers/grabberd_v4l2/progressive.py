"""Negotiation of a progressive stream: size, pixel format and rate, each read back after it is set."""

import errno
from collections.abc import Iterable
from fractions import Fraction

from grabberd.errors import DeviceRefused
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.formats import FORMATS
from grabberd_v4l2.modes import LEAST_HZ, Mode, Wish, in_words, is_near, offered, wishes
from grabberd_v4l2.node import Node
from grabberd_v4l2.options import V4l2Options
from grabberd_v4l2.standards import Scan

_MOST_TRIES = 8
"""Of cameras that grant something else than they offer."""
_CANNOT = (errno.EINVAL, errno.ENOTTY)


def set_up(node: Node, options: V4l2Options) -> tuple[abi.PixFormat, Scan]:
    """Sets format and rate.

    Returns:
        The granted format, and what the camera scans with it.

    Raises:
        DeviceRefused: the camera offers no such stream, or does not grant it.
        OSError: a call failed.
    """
    told = node.pixel_formats()
    formats = [fourcc for fourcc in options.format if fourcc in told]
    if not formats:
        raise DeviceRefused(
            f"{node.path} delivers {', '.join(told) or 'no format at all'}, none of "
            f"{', '.join(options.format)}",
            f"option 'format' allows {', '.join(FORMATS)}; a camera with none of them cannot be used",
        )
    modes = list(offered(node, formats, options.columns_lines, options.rate_hz))
    wanted = wishes(modes, _ranks(options), options.columns_lines, options.rate_hz)
    answers: list[str] = []
    for wish in wanted[:_MOST_TRIES]:
        answer = _granted(node, wish, answers)
        if answer is not None:
            return answer
    raise _refused(node, options, modes, answers)


def _ranks(options: V4l2Options) -> dict[str, int]:
    """Formats by preference: the installer's order, or else what is not compressed before what is."""
    if "format" in options.model_fields_set:
        return {fourcc: rank for rank, fourcc in enumerate(options.format)}
    return {fourcc: int(FORMATS[fourcc].is_compressed) for fourcc in options.format}


def _granted(node: Node, wish: Wish, answers: list[str]) -> tuple[abi.PixFormat, Scan] | None:
    """The stream as granted, if it is the one wished for; else the answer is noted."""
    mode = wish.mode
    try:
        node.set_format(mode.columns, mode.lines, mode.fourcc, Arrangement.NONE)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        return None
    pix = node.format()
    # After the format, which resets the rate in many drivers.
    rate_hz = _set_rate(node, wish.rate_hz)
    got = (abi.fourcc_name(pix.pixelformat), int(pix.width), int(pix.height), int(pix.field))
    if rate_hz is None or not _keeps_to(wish, rate_hz) or got != (mode.fourcc, *mode.size, Arrangement.NONE):
        answers.append(_in_words(got, rate_hz))
        return None
    return pix, Scan.progressive(mode.lines, float(rate_hz))


def _keeps_to(wish: Wish, rate_hz: Fraction) -> bool:
    return rate_hz >= LEAST_HZ and (wish.rate_hz is None or is_near(rate_hz, wish.rate_hz))


def _set_rate(node: Node, rate_hz: Fraction | None) -> Fraction | None:
    """The rate in force after one was requested; None if the camera does not tell."""
    try:
        if rate_hz is not None:
            node.set_interval(1 / rate_hz)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
    try:
        interval = node.interval()
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
        return None
    return None if interval is None else 1 / interval


def _in_words(got: tuple[str, int, int, int], rate_hz: Fraction | None) -> str:
    fourcc, columns, lines, field = got
    rate = "a rate that it does not tell" if rate_hz is None else f"{float(rate_hz):.4g} a second"
    fields = "" if field == Arrangement.NONE else f" in field order {_order_name(field)}"
    return f"{fourcc} {columns}×{lines}{fields} at {rate}"


def _order_name(field: int) -> str:
    return Arrangement(field).name if field in list(Arrangement) else str(field)


def _refused(
    node: Node, options: V4l2Options, modes: Iterable[Mode], answers: Iterable[str]
) -> DeviceRefused:
    asked = [] if options.size is None else [f"size {options.size}"]
    asked += [] if options.rate_hz is None else [f"{options.rate_hz:g} pictures a second"]
    asked.append(f"format {', '.join(options.format)}")
    grants = "; ".join(dict.fromkeys(answers))
    return DeviceRefused(
        f"{node.path}: requested progressive pictures, {', '.join(asked)}; "
        + (f"it grants {grants}, and " if grants else "")
        + f"it offers {in_words(list(modes))}",
        f"choose what it offers (options 'size', 'rate_hz' of {LEAST_HZ} or more, 'format')",
    )
