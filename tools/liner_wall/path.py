"""The tube's way through its states as the pressure difference rises or falls."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tools.liner_wall.equilibrium import NoEquilibrium, Push, State, Tube

_LARGEST_SHIFT_MM = 1.0
"""Of a node between states: a longer way may end on a branch that the wall would not take."""
_BUCKLED_MM = 4.0
"""Off its mounted place, the wall has buckled, and only creases inside its folds still become unstable: finer
than the bricks, and nothing that its outer face shows."""
_STRAYED_MM = 2 * _LARGEST_SHIFT_MM
"""Newton's method does not come back from so far."""
_HALVINGS = 7
"""Of a step before the wall is taken to snap."""
_DRAG = 2e-4
"""N/mm of a node's drag at the start of a snap-through, halved as it calms down."""
_SNAP_STEPS = 200
_CALM_MM = 0.02
"""A flow that slow has all but come to rest: Newton's method without drag finds it from there."""


class Rest(NamedTuple):
    """The wall at rest.

    Attributes:
        outer_mpa: pressure difference, outside over inside.
        state: the tube's state.
        snapped: true if the wall snapped on the way here.
    """

    outer_mpa: float
    state: State
    snapped: bool


def follow(
    tube: Tube, start: State, from_mpa: float, to_mpa: float, step_mpa: float, push: Push
) -> Iterator[Rest]:
    """States from one pressure difference to another, near enough to each other to interpolate between.

    Args:
        tube: the tube.
        start: a state of equilibrium at the first pressure, or near one.
        from_mpa: the first pressure difference.
        to_mpa: the last, greater or less.
        step_mpa: largest difference between two states.
        push: contact on the inner face.

    Raises:
        NoEquilibrium: the wall comes to rest nowhere.
    """
    sign = 1.0 if to_mpa >= from_mpa else -1.0
    rest = Rest(from_mpa, tube.solve(start, from_mpa, push), snapped=False)
    yield rest
    step, smallest = step_mpa, step_mpa / 2**_HALVINGS
    while rest.outer_mpa != to_mpa:
        target = rest.outer_mpa + sign * step
        if sign * (to_mpa - target) < smallest:
            target = to_mpa
        reached = _near(tube, rest.state, target, push)
        if reached is not None:
            rest = Rest(target, reached, snapped=False)
            step = min(2 * step, step_mpa)
        elif step > smallest:
            step /= 2
            continue
        else:
            rest = Rest(target, _snap(tube, rest.state, target, push), snapped=True)
        yield rest


def _near(tube: Tube, state: State, pressure_mpa: float, push: Push) -> State | None:
    try:
        reached = tube.solve(state, pressure_mpa, push, within_mm=_STRAYED_MM)
    except NoEquilibrium:
        return None
    shift_mm = float(np.abs(reached.nodes_mm - state.nodes_mm).max())
    if shift_mm > _LARGEST_SHIFT_MM:
        return None
    # Beyond buckling, Newton's method also finds the round wall and modes that no wall would stay in.
    buckled = np.abs(reached.nodes_mm - tube.friction.anchors_mm).max() > _BUCKLED_MM
    return reached if buckled or tube.is_stable(reached, pressure_mpa, push) else None


def _snap(tube: Tube, state: State, pressure_mpa: float, push: Push) -> State:
    """Slow flow to the next state of rest: steps of implicit time, each as long as the wall can follow."""
    drag = _DRAG
    for _ in range(_SNAP_STEPS):
        try:
            reached = tube.solve(state, pressure_mpa, push, drag, _STRAYED_MM)
        except NoEquilibrium:
            drag *= 4
            continue
        shift_mm = float(np.abs(reached.nodes_mm - state.nodes_mm).max())
        if shift_mm > _LARGEST_SHIFT_MM:
            drag *= 4
            continue
        state = reached
        drag /= 2
        if shift_mm < _CALM_MM:
            rest = _near(tube, state, pressure_mpa, push)
            if rest is not None:
                return rest
    raise NoEquilibrium(f"the wall does not come to rest at {1000 * pressure_mpa:.3g} kPa")
