"""Unknowns of an adjustment: which of the views' parameters are free, held, shared between views or tied."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import PARAMETERS, View
from grabberd.errors import InputError

Array = NDArray[np.float64]

LENS = ("f_mm", "x0_px", "y0_px", "b3", "b4", "b5", "b6", "b7")
"""Parameters common to views through one lens; b1, b2, b8, b9 belong to the mirrors."""


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """U unknowns behind the 18 parameters of each of V views.

    Attributes:
        names: U names: "left.f_mm"; "lens.f_mm" if all views share it; "left.b8=b9" if tied.
        number: (V, 18) intp, unknown behind each parameter; −1 if it is held.
    """

    names: tuple[str, ...]
    number: NDArray[np.intp]

    @classmethod
    def of(
        cls,
        views: Sequence[View],
        free: Collection[str] = PARAMETERS,
        *,
        shared: Collection[str] = (),
        tied: bool = False,
    ) -> "Unknowns":
        """Choose the unknowns of views.

        Args:
            views: The views.
            free: Names of parameters to adjust: "b3" for all views, "left.b3" for one.
            shared: Parameters identical in all views, such as `LENS`.
            tied: True for b9 = b8 in every view, the paper's own model.

        Raises:
            InputError: A name is unknown, or a shared parameter is not free in all views.
        """
        _check_names(views, free, shared)
        names: dict[str, int] = {}
        number = np.full((len(views), len(PARAMETERS)), -1, np.intp)
        for index, view in enumerate(views):
            for column, parameter in enumerate(PARAMETERS):
                if parameter in free or f"{view.name}.{parameter}" in free:
                    name = _name(view.name, parameter, parameter in shared, tied)
                    number[index, column] = names.setdefault(name, len(names))
        return cls(tuple(names), number)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def selection(self) -> Array:
        """(18 V, U) float64 zeros and ones: changes of the parameters from those of the unknowns."""
        flat = self.number.ravel()
        chosen: Array = (flat[:, np.newaxis] == np.arange(len(self))).astype(np.float64)
        return chosen

    def derivatives(self, views: Sequence[View]) -> Array:
        """(18 V, U) derivatives of the views' parameters by the unknowns."""
        return self.selection

    def values(self, views: Sequence[View]) -> Array:
        """(U,) values of the unknowns; the mean of parameters that share one."""
        flat, number = np.array([view.vector() for view in views]).ravel(), self.number.ravel()
        chosen = number >= 0
        total = np.bincount(number[chosen], flat[chosen], len(self))
        return total / np.bincount(number[chosen], minlength=len(self))

    def with_values(self, views: Sequence[View], values: Array) -> tuple[View, ...]:
        """Copy the views with other values (U,) of the unknowns; held parameters stay."""
        known = np.array([view.vector() for view in views])
        vectors = np.where(self.number >= 0, np.append(values, 0.0)[self.number], known)
        return tuple(view.with_vector(vector) for view, vector in zip(views, vectors, strict=True))

    def without(self, dropped: Collection[str]) -> "Unknowns":
        """Drop some unknowns: their parameters are held."""
        kept = [index for index, name in enumerate(self.names) if name not in dropped]
        renumbered = np.full(len(self) + 1, -1, np.intp)
        renumbered[kept] = np.arange(len(kept))
        return Unknowns(tuple(self.names[index] for index in kept), renumbered[self.number])

    def moved(self, views: Sequence[View], step: Array) -> tuple[View, ...]:
        """Apply a step (U,) of the unknowns to the views."""
        changes = np.append(step, 0.0)[self.number]
        return tuple(
            view.with_vector(view.vector() + change) for view, change in zip(views, changes, strict=True)
        )


def _name(view: str, parameter: str, shared: bool, tied: bool) -> str:
    label = "b8=b9" if tied and parameter in {"b8", "b9"} else parameter
    return f"{'lens' if shared else view}.{label}"


def _check_names(views: Sequence[View], free: Collection[str], shared: Collection[str]) -> None:
    own = {f"{view.name}.{parameter}" for view in views for parameter in PARAMETERS}
    unknown = sorted((set(free) - own - set(PARAMETERS)) | (set(shared) - set(PARAMETERS)))
    if unknown:
        raise InputError(
            f"no parameter is called {', '.join(unknown)}",
            f"parameters are {', '.join(PARAMETERS)}; one view's alone: {views[0].name}.{PARAMETERS[0]}",
        )
    if single := sorted(set(shared) - set(free)):
        raise InputError(
            f"{', '.join(single)} cannot be shared without being adjusted in all views",
            "adjust the parameter in all views, or do not share it",
        )
