"""From blobs of two views to the points of an object's targets (paper 3.7)."""

from grabberd.reconstruction.image_noise import ImageNoise
from grabberd.reconstruction.intersection import intersect
from grabberd.reconstruction.object_model import ObjectModel
from grabberd.reconstruction.points import Points
from grabberd.reconstruction.view_blobs import ViewBlobs

__all__ = ["ImageNoise", "ObjectModel", "Points", "ViewBlobs", "intersect"]
