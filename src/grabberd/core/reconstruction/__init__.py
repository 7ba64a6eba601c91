"""Reconstruction: from blobs in two views to the points of an object's targets (paper 3.7).

Object model and calibration decide which blob is which target (`correspondence`), and prediction carries that
from field to field (`tracking`); `intersection` computes where the rays of both views meet, with covariance;
`coverage` counts
which targets were found, and why the others were not; `smoothing` filters points over time, `accuracy`
compares them with the truth and with the calibration.
"""

from grabberd.core.reconstruction.correspondence.correspondence import Correspondence
from grabberd.core.reconstruction.correspondence.displacement_field import Smoothness
from grabberd.core.reconstruction.correspondence.settings import CorrespondenceSettings
from grabberd.core.reconstruction.correspondence.single_view_search import SingleViewSearch
from grabberd.core.reconstruction.coverage.coverage import Coverage
from grabberd.core.reconstruction.coverage.tally import CoverageTally
from grabberd.core.reconstruction.intersection import intersect
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import Points, SingleViewImages
from grabberd.core.reconstruction.tracking.tracker import Track, Tracker, TrackingSettings
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
