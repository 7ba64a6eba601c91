"""Reasons from the pictures: movement, number of fields, targets seen, focus and light."""

from collections.abc import Iterator

from grabberd.core.chain.calibration.acceptance.reason import REMARK, Limits, Reason, graded
from grabberd.core.chain.calibration.calibration_result import CalibrateResult

MOVED_PX = Limits(0.04, 0.1)
"""A stand at rest shows .013 px at 8 bits and .021 at 1, a drift of .2 px over the capture .06."""
ENOUGH_FIELDS = 16
UNSEEN_SHARE = Limits(0.1, 0.5)
LARGE_DISC = 2.1
"""Area of a disc over that of its geometric image; in focus it is 1.5 to 1.7."""
UNEVEN_DISCS, UNEVEN_SIGMA = 1.5, 2.0
"""Ratios between the views, of these areas and of the pointing σ."""


def picture_reasons(result: CalibrateResult) -> Iterator[Reason]:
    """Yield what is wrong with the pictures."""
    yield from _movement(result)
    yield from _seen(result)
    yield from _focus(result)
    yield from _light(result)


def _movement(result: CalibrateResult) -> Iterator[Reason]:
    moved = max(one.rms_px for one in result.stillness)
    yield from graded(moved, MOVED_PX).reason(
        "moved",
        f"the picture moved by {moved:.2f} px rms during the capture, "
        f"{max(one.drift_px for one in result.stillness):.2f} px of it steadily",
        "fasten the calibration frame's stand, touch nothing, and repeat the capture",
        {"px": moved},
    )
    if (count := result.images[0].of_fields) < ENOUGH_FIELDS:
        yield Reason(
            "short",
            REMARK,
            f"only {count} fields: too few to average out noise and line jitter",
            "take two seconds or more",
            {"n": count},
        )


def _seen(result: CalibrateResult) -> Iterator[Reason]:
    of, network = len(result.frame), result.adjustment.network
    for index, view in enumerate(result.views):
        found = int((network.view == index).sum())
        yield from graded(1 - found / of, UNSEEN_SHARE).reason(
            "few",
            f"the {view.name} view shows {found} of {of} targets",
            "move the calibration frame until both views show all of it; check light and threshold",
            {"view": view.name, "n": found, "of": of},
        )


def _focus(result: CalibrateResult) -> Iterator[Reason]:
    for view, share in zip(result.views, result.disc_share, strict=True):
        if share > LARGE_DISC:
            yield Reason(
                "large",
                REMARK,
                f"the discs of the {view.name} view appear {share:.1f} times as large as their geometric "
                "image: the picture is out of focus, or far too bright",
                "focus the lens until the targets are smallest; close the iris a little",
                {"view": view.name, "times": share},
            )


def _light(result: CalibrateResult) -> Iterator[Reason]:
    areas, sigmas = result.disc_share, result.view_sigma_px
    darker = result.views[sigmas.index(max(sigmas))].name
    larger, less_certain = max(areas) / min(areas), max(sigmas) / min(sigmas)
    if larger > UNEVEN_DISCS or less_certain > UNEVEN_SIGMA:
        yield Reason(
            "uneven",
            REMARK,
            f"the {darker} view is darker than the other: its targets are {less_certain:.1f} times as "
            f"uncertain, and the areas of the discs differ by a factor of {larger:.1f}",
            "light both views alike; clean the mirrors of the darker one",
            {"view": darker, "times": less_certain},
        )
