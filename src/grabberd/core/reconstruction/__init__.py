"""Reconstruction: from blobs in two views to the points of an object's targets (paper 3.7).

Object model and calibration decide which blob is which target (`correspondence`), and prediction carries that
from field to field (`tracking`); `intersection` computes where the rays of both views meet, with covariance;
`coverage_tally` counts which targets were found and why the others were not, and `coverage` judges the
counts; `smoothing` filters points over time, `accuracy` and `length_errors` compare them with the truth,
`drift_check` with the calibration, `field_order` with one another.
"""

from grabberd.core.reconstruction.correspondence.agreement import CorrespondenceSettings
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence, SingleViewSearch
from grabberd.core.reconstruction.correspondence.displacement_field import Smoothness
from grabberd.core.reconstruction.coverage import Coverage
from grabberd.core.reconstruction.coverage_tally import CoverageTally
from grabberd.core.reconstruction.intersection import intersect
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import Points, SingleViewImages
from grabberd.core.reconstruction.tracking import Track, Tracker, TrackingSettings
from grabberd.core.reconstruction.view_blobs import ImageNoise, ViewBlobs

__all__ = [
    "Correspondence",
    "CorrespondenceSettings",
    "Coverage",
    "CoverageTally",
    "ImageNoise",
    "ObjectModel",
    "Points",
    "SingleViewImages",
    "SingleViewSearch",
    "Smoothness",
    "Track",
    "Tracker",
    "TrackingSettings",
    "ViewBlobs",
    "intersect",
]
