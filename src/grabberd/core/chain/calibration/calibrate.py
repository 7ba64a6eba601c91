"""Fields of the calibration frame in, both virtual cameras out (paper 3.6, figure 8)."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, repeat

import numpy as np

from grabberd.core.arrays import Mask
from grabberd.core.calibration.adjustment.adjustment import Adjustment
from grabberd.core.calibration.adjustment.frame_poses import PosedUnknowns, frame_poses, joined, of_first_pose
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.calibration.adjustment.normal_equations import check_depth, check_rank
from grabberd.core.calibration.identification.decision import mirrored_hint
from grabberd.core.calibration.identification.manual_identification import Mark
from grabberd.core.calibration.local_field_trial import LocalFieldTrial, try_local_fields
from grabberd.core.calibration.mean_images import stillness
from grabberd.core.calibration.residuals import Blunder, normality, with_unmodelled, without_blunders
from grabberd.core.calibration.significance import (
    Elimination,
    Validation,
    compare,
    cross_validate,
    eliminate,
    with_stated_covariance,
)
from grabberd.core.calibration.validity import volume_sigma
from grabberd.core.chain.calibration.calibration_result import CalibrateResult, CalibrateSettings
from grabberd.core.chain.calibration.frame_capture import FrameCapture
from grabberd.core.field import NumberedField
from grabberd.core.geometry import PARAMETERS, NominalRig, View
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import MeasurementError, RankDeficient

# f, x0, y0: a planar target field does not separate them from the camera's position.
INTERIOR = PARAMETERS[:3]
MOST_BLUNDERS = 0.1
# An image point off by a pixel is a wrong identity or a wrong certificate, not an uneven mirror.
MOST_UNMODELLED_PX = 1.0
_DOUBT = 0.5
"""Probability that distortion terms are not zero though no test finds them: even odds. Behind uneven mirrors
it is 1, since unevenness has a part of every term's shape."""
BLOCKS = 6
"""Blocks of targets that cross-validation holds out in turn."""


def calibrate(
    captures: Iterable[Iterable[NumberedField]],
    nominal: NominalRig,
    frame: ObjectModel,
    settings: CalibrateSettings | None = None,
    by_hand: Sequence[Sequence[Mark]] = (),
) -> CalibrateResult:
    """Calibrate both virtual cameras from captures of the calibration frame, in one pose or several.

    The first pose defines the coordinates; each other is six more unknowns. The rig then explains the same
    targets from several sides, at many more places of the picture, and their certified places are checked by
    it.

    Args:
        captures: fields of each pose, any number, of both parities; the calibration frame stands still within
            one.
        nominal: the rig as it was built, each number to ten per cent.
        frame: the calibration frame's targets.
        settings: settings of the calibration.
        by_hand: targets marked by hand in each capture, in order; none where there are fewer.

    Raises:
        MeasurementError: no captures or fields, a calibration frame that moves, too few targets, a planar
            calibration frame, an unclear identification, or no convergence; the message says which.
    """
    settings = settings or CalibrateSettings()
    _check_depth(frame, settings)
    taken = list(_taken(captures, nominal, frame, settings, by_hand))
    networks = [
        one.network.starting_from([*_held_as_built(one.network.views, nominal, settings)]) for one in taken
    ]
    done, local = _explained(joined(networks) if len(networks) > 1 else networks[0], settings, nominal)
    final = _final(done, local, settings)
    return _result(taken[0], done, local, final, nominal, frame, settings)


def _taken(
    captures: Iterable[Iterable[NumberedField]],
    nominal: NominalRig,
    frame: ObjectModel,
    settings: CalibrateSettings,
    by_hand: Sequence[Sequence[Mark]],
) -> Iterator[FrameCapture]:
    number = 0
    marks = chain(by_hand, repeat(()))
    for number, (fields, marked) in enumerate(zip(captures, marks, strict=False), start=1):
        try:
            yield FrameCapture.of(fields, nominal, frame, settings, marked)
        except MeasurementError as error:
            if number > 1:
                # In place, so that its class stays what callers look at.
                error.args = (f"capture {number}: {error.message}",)
                error.message = error.args[0]
            raise
    if not number:
        raise MeasurementError("there is no capture to calibrate from", "name at least one")


def _result(
    first: FrameCapture,
    done: "_Adjusted",
    local: LocalFieldTrial | None,
    final: Adjustment,
    nominal: NominalRig,
    frame: ObjectModel,
    settings: CalibrateSettings,
) -> CalibrateResult:
    """Collect what is reported; of several poses, pictures and residuals are those of the first."""
    adjustment, rig = of_first_pose(done.adjustment), of_first_pose(final)
    validation, unvalidated = _validated(done.adjustment)
    still_left, still_right = (stillness(*one) for one in zip(first.seen, first.images, strict=True))
    pointing_px = first.pointing_px
    return CalibrateResult(
        frame=frame,
        nominal=nominal,
        settings=settings,
        bits=first.bits,
        y_step=first.y_step,
        images=first.images,
        identification=first.identification,
        adjustment=adjustment,
        elimination=done.elimination,
        blunders=done.blunders,
        unmodelled_px=done.unmodelled_px,
        local=local,
        final=rig,
        differences=compare(adjustment),
        normality=normality(adjustment),
        validation=validation,
        volume=volume_sigma(rig, pointing_px, local_fields=local.both if local else ()),
        pointing_px=pointing_px,
        unvalidated=unvalidated,
        stillness=(still_left, still_right),
        repeated=first.repeated,
        merging=first.merging,
        disc_share=first.disc_share(adjustment.views, frame),
        view_sigma_px=first.view_sigma_px,
        poses=frame_poses(final),
        marks=first.marks,
    )


def _check_depth(frame: ObjectModel, settings: CalibrateSettings) -> None:
    """Check that the targets are not coplanar if interior parameters are adjusted."""
    if interior := [name for name in settings.free if name.rpartition(".")[2] in INTERIOR]:
        check_depth(frame.xyz_mm, interior, f"the targets of calibration frame {frame.name}")


def _held_as_built(
    views: tuple[View, ...], nominal: NominalRig, settings: CalibrateSettings
) -> Iterator[View]:
    """The views with their nominal values for all interior parameters that are not adjusted."""
    handedness = views[0].handedness, views[1].handedness
    for view, built in zip(views, nominal.views(handedness), strict=True):
        free = [name in settings.free or f"{view.name}.{name}" in settings.free for name in PARAMETERS]
        own = np.array(free) | np.isin(PARAMETERS, PARAMETERS[3:9])
        # Identification fits some interior parameters of its own to find the targets: what is held must be
        # held at the nominal value, not at that by-product. The pose (3 to 8) stays as the starting value.
        yield view.with_vector(np.where(own, view.vector(), built.vector()))


@dataclass(frozen=True, slots=True, eq=False)
class _Adjusted:
    """The adjusted functional model, with the blunders, tests and weights that led to it."""

    adjustment: Adjustment
    blunders: tuple[Blunder, ...]
    elimination: Elimination | None
    unmodelled_px: float


def _explained(
    network: Network, settings: CalibrateSettings, nominal: NominalRig
) -> tuple[_Adjusted, LocalFieldTrial | None]:
    """Adjust and try local fields; if nothing fits, say whether mirrored halves are the reason."""
    try:
        done = _adjusted(network, settings)
        return done, _local(done, nominal, settings)
    except MeasurementError as error:
        hint = mirrored_hint([view.handedness for view in network.views[:2]], nominal.handedness)
        if hint is None or isinstance(error, RankDeficient):
            raise
        raise MeasurementError(error.message, hint) from error


def _adjusted(network: Network, settings: CalibrateSettings) -> _Adjusted:
    unknowns = _unknowns(network.views, settings)
    check_rank(network, unknowns)
    adjustment, blunders, unmodelled_px = _sound(network, unknowns)
    if unmodelled_px > MOST_UNMODELLED_PX:
        raise MeasurementError(
            f"the image points are off by {unmodelled_px:.2f} px from any rig of this model",
            "adjust more parameters, and check which target is which and the calibration frame's file",
        )
    elimination = None
    if settings.alpha is not None:
        clean = adjustment.network.starting_from(adjustment.views)
        elimination = eliminate(clean, unknowns, settings.alpha)
        adjustment = elimination.adjustment
    return _Adjusted(adjustment, blunders, elimination, unmodelled_px)


def _unknowns(views: tuple[View, ...], settings: CalibrateSettings) -> Unknowns:
    """Unknowns of the rig, and of the poses of the calibration frame where there are several."""
    rig = Unknowns.of(views[:2], settings.free, shared=settings.shared, tied=settings.tied)
    return PosedUnknowns.of_rig(rig, len(views) // 2) if len(views) > 2 else rig


def _sound(network: Network, unknowns: Unknowns) -> tuple[Adjustment, tuple[Blunder, ...], float]:
    """Adjust without blunders and with realistic weights, alternating, since each depends on the other."""
    blunders: tuple[Blunder, ...] = ()
    # One blunder inflates the unmodelled share and so hides the next: it is estimated again after each
    # removal. With more than a tenth removed the fault is not in single points; it stops there.
    while True:
        # Means of many fields are known better than mirrors are even. By their own σ alone σ0 came out near
        # 5, good points left as blunders, and the few with the least scatter decided everything.
        weighted, unmodelled_px = with_unmodelled(network, unknowns)
        adjustment, more = without_blunders(weighted, unknowns)
        blunders += more
        if not more or len(blunders) > MOST_BLUNDERS * len(weighted):
            return adjustment, blunders, unmodelled_px
        network = network.select(_kept(network, adjustment.network)).starting_from(adjustment.views)


def _kept(network: Network, part: Network) -> Mask:
    """(M,) True for image points of a network that are also in a part of it."""
    count = len(network.target_mm)
    return np.isin(network.view * count + network.target, part.view * count + part.target)


def _local(done: _Adjusted, nominal: NominalRig, settings: CalibrateSettings) -> LocalFieldTrial | None:
    if not settings.local_field:
        return None
    # Collocation explains what the weights only allowed for, and so needs the points' own σ again.
    return try_local_fields(done.adjustment, nominal.lines, unmodelled_px=done.unmodelled_px)


def _final(done: _Adjusted, local: LocalFieldTrial | None, settings: CalibrateSettings) -> Adjustment:
    """The calibration's own adjustment, with all that is not known of it."""
    adjustment = local.adjustment if local else done.adjustment
    unknowns = _unknowns(adjustment.views, settings)
    return with_stated_covariance(adjustment, unknowns, 1.0 if local and local.accepted else _DOUBT)


def _validated(adjustment: Adjustment) -> tuple[Validation | None, str]:
    """Cross-validation of the global model, or the reason why too few targets are left for it."""
    network = adjustment.network.starting_from(adjustment.views)
    try:
        return cross_validate(network, adjustment.unknowns, BLOCKS), ""
    except MeasurementError as error:
        return None, error.message
