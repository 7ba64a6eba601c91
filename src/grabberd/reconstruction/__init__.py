"""Reconstruction: from blobs in two views to the points of an object's targets (paper 3.7).

Object model and calibration decide which blob is which target (`correspondence`), and prediction carries that
from field to field (`tracking`); `intersection` computes where the rays of both views meet, with covariance;
`coverage` counts
which targets were found, and why the others were not; `smoothing` filters points over time, `accuracy`
compares them with the truth and with the calibration.
"""

from grabberd.reconstruction.correspondence.correspondence import Correspondence
from grabberd.reconstruction.correspondence.displacement_field import Smoothness
from grabberd.reconstruction.correspondence.settings import CorrespondenceSettings
from grabberd.reconstruction.correspondence.single_view_search import SingleViewSearch
from grabberd.reconstruction.coverage.coverage import Coverage
from grabberd.reconstruction.coverage.tally import CoverageTally
from grabberd.reconstruction.intersection import intersect
from grabberd.reconstruction.object_model import ObjectModel
from grabberd.reconstruction.points import Points, SingleViewImages
from grabberd.reconstruction.tracking.tracker import Track, Tracker, TrackingSettings
from grabberd.reconstruction.view_blobs import ImageNoise, ViewBlobs

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
