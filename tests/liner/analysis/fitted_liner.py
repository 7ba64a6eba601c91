"""A solved liner, and the load fitted to its points state after state."""

import numpy as np

from grabberd_liner.analysis.load.mounting import Mounting
from grabberd_liner.analysis.load.pressure import LoadSeries
from grabberd_liner.analysis.load.wall_model import Difference, LoadPrior, TubePrior, WallModel
from grabberd_liner.analysis.load.wall_surfaces import MiddleSurfaces
from liner.analysis.walls import EIGHT_BITS_MM, as_points, solved


class FittedLiner:
    """A solved liner with the middle surfaces of its wall."""

    def __init__(self, name):
        self.liner = solved(name)
        self.material = self.liner.zones()[0].material
        reference = as_points(self.liner.places_mm(0.0), np.full(3, 0.005))
        self.mounting = Mounting.of(self.liner.grid, self.material, reference)
        self.model = WallModel(
            self.mounting.half,
            self.mounting.targets,
            LoadPrior(),
            TubePrior.of(self.material),
            mirrored=False,
        )
        self.series, self.middles = LoadSeries(self.model), MiddleSurfaces(self.model, self.material)

    def fitted(self, outer_kpa, seed=0):
        sights = self.mounting.sights(self.liner.points(outer_kpa, seed, EIGHT_BITS_MM), self.liner.grid)
        return self.series.load(sights, Difference(outer_kpa, 0.5))
