"""Reconstruction: from blobs in two views to the points of an object's targets (paper 3.7).

Object model and calibration decide which blob is which target (`correspondence`), and prediction carries that
from field to field (`tracking`); `intersection` computes where the rays of both views meet, with covariance;
`coverage_tally` counts which targets were found and why the others were not, and `coverage` judges the
counts; `smoothing` filters points over time, `accuracy` and `length_errors` compare them with the truth,
`drift_check` with the calibration, `field_order` with one another.
"""

from grabberd.core.reconstruction.correspondence.agreement import (
    CorrespondenceSettings as CorrespondenceSettings,
)
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence as Correspondence
from grabberd.core.reconstruction.correspondence.correspondence import SingleViewSearch as SingleViewSearch
from grabberd.core.reconstruction.correspondence.displacement_field import Smoothness as Smoothness
from grabberd.core.reconstruction.coverage import Coverage as Coverage
from grabberd.core.reconstruction.coverage_tally import CoverageTally as CoverageTally
from grabberd.core.reconstruction.disc_centres import DiscCentres as DiscCentres
from grabberd.core.reconstruction.object_model import ObjectModel as ObjectModel
from grabberd.core.reconstruction.points import ImageNoise as ImageNoise
from grabberd.core.reconstruction.points import Points as Points
from grabberd.core.reconstruction.points import SingleViewImages as SingleViewImages
from grabberd.core.reconstruction.points import ViewBlobs as ViewBlobs
from grabberd.core.reconstruction.points import intersect as intersect
from grabberd.core.reconstruction.tracking import Track as Track
from grabberd.core.reconstruction.tracking import Tracker as Tracker
from grabberd.core.reconstruction.tracking import TrackingSettings as TrackingSettings
