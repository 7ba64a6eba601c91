"""From points to shape, strain, tension and pressure (paper 3.8)."""

from grabberd_liner.analysis.camera import Camera, Hits, Raster, cast, viewing_axes
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.collapse import Collapse, RampLevel, collapse
from grabberd_liner.analysis.load.empty_ramp import LinerValues, liner_values
from grabberd_liner.analysis.load.load_prior import Difference
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureMap, Touch, first_touch
from grabberd_liner.analysis.load.pressure_model import UNSEEN, PressureModel, SettledWall
from grabberd_liner.analysis.load.wall_surfaces import MiddleSurface
from grabberd_liner.analysis.pulsation.movement import Movement, TimedPoints, first_movement
from grabberd_liner.analysis.pulsation.phase_average import PhaseAverage, Variation, phase_average, variation
from grabberd_liner.analysis.pulsation.phases import Phases, iso_phases, wall_phases
from grabberd_liner.analysis.pulsation.pulsation import Pulsation, fit_pulsation
from grabberd_liner.analysis.pulsation.waveform import Waveform
from grabberd_liner.analysis.surface.face import Area, Face, supported_places, surface_area
from grabberd_liner.analysis.surface.fitting import choose_smoothing, fit_surface, left_out_problems, possible
from grabberd_liner.analysis.surface.free_surface import Height, Tube, fit_free_surface, free_shape
from grabberd_liner.analysis.surface.jets import ORDERS, Jets, index
from grabberd_liner.analysis.surface.sections import (
    Plane,
    Section,
    section,
    sections,
    symmetry_plane,
    volume_mm3,
)
from grabberd_liner.analysis.surface.smoothing import Smoothing
from grabberd_liner.analysis.surface.surface import PER_PITCH, Mesh, Surface, middles, propagate
from grabberd_liner.analysis.synthetic import Agreement, SyntheticView, agreement, grey_at, synthetic_view
from grabberd_liner.analysis.vacuum.vacuum import ConstantVacuum, LoggedVacuum, PulsatorWave, VacuumSource
from grabberd_liner.analysis.vacuum.vacuum_log import VacuumLog, read_vacuum_log
from grabberd_liner.analysis.vacuum.vacuum_offset import Offset, WallLag, find_offset
from grabberd_liner.analysis.wall.material import Material, Zone, lacking, read_zones, wall_at
from grabberd_liner.analysis.wall.strain import (
    EdgeStrain,
    Forms,
    Places,
    Principal,
    Strain,
    TriangleStrain,
    curvature_per_m,
    edge_strain,
    middle_forms,
    nominal_places,
    outer_forms,
    outer_places,
    outer_strain,
    triangle_strain,
)

__all__ = [
    "ORDERS",
    "PER_PITCH",
    "UNSEEN",
    "Agreement",
    "Area",
    "Camera",
    "ChamberVacuum",
    "Collapse",
    "ConstantVacuum",
    "Difference",
    "EdgeStrain",
    "Estimate",
    "Face",
    "Forms",
    "Grid",
    "Height",
    "Hits",
    "Jets",
    "LinerValues",
    "LoggedVacuum",
    "Material",
    "Mesh",
    "MiddleSurface",
    "Movement",
    "Offset",
    "PhaseAverage",
    "Phases",
    "Places",
    "Plane",
    "PressureMap",
    "PressureModel",
    "Principal",
    "Pulsation",
    "PulsatorWave",
    "RampLevel",
    "Raster",
    "Section",
    "SettledWall",
    "Smoothing",
    "Strain",
    "Surface",
    "SyntheticView",
    "TimedPoints",
    "Touch",
    "TriangleStrain",
    "Tube",
    "VacuumLog",
    "VacuumSource",
    "Variation",
    "WallLag",
    "Waveform",
    "Zone",
    "agreement",
    "cast",
    "choose_smoothing",
    "collapse",
    "curvature_per_m",
    "edge_strain",
    "find_offset",
    "first_movement",
    "first_touch",
    "fit_free_surface",
    "fit_pulsation",
    "fit_surface",
    "free_shape",
    "grey_at",
    "index",
    "iso_phases",
    "lacking",
    "left_out_problems",
    "liner_values",
    "middle_forms",
    "middles",
    "nominal_places",
    "outer_forms",
    "outer_places",
    "outer_strain",
    "phase_average",
    "possible",
    "propagate",
    "read_vacuum_log",
    "read_zones",
    "section",
    "sections",
    "supported_places",
    "surface_area",
    "symmetry_plane",
    "synthetic_view",
    "triangle_strain",
    "variation",
    "viewing_axes",
    "volume_mm3",
    "wall_at",
    "wall_phases",
]
