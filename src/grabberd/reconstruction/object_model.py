"""The prior knowledge of an object: where its targets nominally are, and which are neighbours."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class ObjectModel:
    """N targets; a calibration frame's file has the same form.

    Attributes:
        name: what the object is called.
        target: (N,) int32, ids, ascending.
        xyz_mm: (N, 3) float64, nominal places in the object's frame.
        row: (N,) int32, row of the target grid; `column`: (N,) int32. Neighbours differ by one in one of them.
        target_diameter_mm: diameter of the discs.
        sigma_mm: standard deviation of the nominal places.
    """

    name: str
    target: NDArray[np.int32]
    xyz_mm: NDArray[np.float64]
    row: NDArray[np.int32]
    column: NDArray[np.int32]
    target_diameter_mm: float
    sigma_mm: float

    def __len__(self) -> int:
        return len(self.target)

    @classmethod
    def from_document(cls, document: Mapping[str, object]) -> "ObjectModel":
        """The model from a YAML file's content.

        Raises:
            InputError: a key is missing, unknown or of a wrong type, an id or grid place is given twice.
        """
        raise NotImplementedError
