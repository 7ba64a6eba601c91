"""Camera geometry: where a point of the object appears, and on which ray an image point lies (paper 3.6).

A `View` is one virtual camera, a `Calibration` the two of them with their covariance as stored in a document,
a `Rig` the same views prepared for fast computation. The functional model is the paper's (4)–(7) with b1 as
an affinity and b8 and b9 separate; its derivatives are analytic, its inverse is iterated. Everything is in
frame pixels and in millimetres of the object's frame; nothing here knows about fields, targets or
adjustments.
"""

from grabberd.core.geometry.calibration import Calibration
from grabberd.core.geometry.document_reader import Reading
from grabberd.core.geometry.functional_model import (
    Discs,
    approach,
    correct_all,
    directions_all,
    image,
    linearise,
    linearise_corrections,
    linearise_parameters,
    parameter_derivatives,
    parameter_slopes,
    project,
    project_all,
    rays,
)
from grabberd.core.geometry.glass import Plate, project_through, seen_through
from grabberd.core.geometry.local_field import ImageMovement, LocalField, LocalFields
from grabberd.core.geometry.rig import NominalRig, Rig
from grabberd.core.geometry.view import (
    PARAMETERS,
    View,
    distortion,
    rotation_angles,
    rotation_derivatives,
    rotation_matrix,
)

__all__ = [
    "PARAMETERS",
    "Calibration",
    "Discs",
    "ImageMovement",
    "LocalField",
    "LocalFields",
    "NominalRig",
    "Plate",
    "Reading",
    "Rig",
    "View",
    "approach",
    "correct_all",
    "directions_all",
    "distortion",
    "image",
    "linearise",
    "linearise_corrections",
    "linearise_parameters",
    "parameter_derivatives",
    "parameter_slopes",
    "project",
    "project_all",
    "project_through",
    "rays",
    "rotation_angles",
    "rotation_derivatives",
    "rotation_matrix",
    "seen_through",
]
