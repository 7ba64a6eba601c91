"""From points to shape, strain, tension and pressure (paper 3.8)."""

from grabberd.analysis.estimate import Estimate
from grabberd.analysis.grid import Grid
from grabberd.analysis.load.compression.touch import Touch, first_touch
from grabberd.analysis.load.load_prior import Difference
from grabberd.analysis.load.middle_surface import MiddleSurface
from grabberd.analysis.load.pressure import ChamberVacuum, PressureMap
from grabberd.analysis.load.pressure_model import UNSEEN, PressureModel, SettledWall
from grabberd.analysis.load.ramp.collapse import Collapse, collapse
from grabberd.analysis.load.ramp.empty_ramp import LinerValues, liner_values
from grabberd.analysis.load.ramp.ramp_levels import RampLevel
from grabberd.analysis.pulsation.movement import Movement, TimedPoints, first_movement
from grabberd.analysis.pulsation.phase_average import PhaseAverage, phase_average
from grabberd.analysis.pulsation.phases import Phases, iso_phases, wall_phases
from grabberd.analysis.pulsation.pulsation import Pulsation, fit_pulsation
from grabberd.analysis.pulsation.variation import Variation, variation
from grabberd.analysis.pulsation.waveform import Waveform
from grabberd.analysis.surface.area import Area, surface_area
from grabberd.analysis.surface.face import Face, supported_places
from grabberd.analysis.surface.fitting import choose_smoothing, fit_surface, left_out_problems, possible
from grabberd.analysis.surface.free_surface import Height, Tube, fit_free_surface, free_shape
from grabberd.analysis.surface.jets import ORDERS, Jets, index
from grabberd.analysis.surface.mesh import PER_PITCH, Mesh, middles
from grabberd.analysis.surface.outlines import Plane
from grabberd.analysis.surface.sections import Section, section, sections, symmetry_plane, volume_mm3
from grabberd.analysis.surface.smoothing import Smoothing
from grabberd.analysis.surface.surface import Surface, propagate
from grabberd.analysis.vacuum.vacuum import ConstantVacuum, LoggedVacuum, PulsatorWave, VacuumSource
from grabberd.analysis.vacuum.vacuum_log import VacuumLog, read_vacuum_log
from grabberd.analysis.vacuum.vacuum_offset import Offset, WallLag, find_offset
from grabberd.analysis.view.camera import Camera, viewing_axes
from grabberd.analysis.view.ray_casting import Hits, Raster, cast
from grabberd.analysis.view.registration import Agreement, agreement
from grabberd.analysis.view.synthetic import SyntheticView, grey_at, synthetic_view
from grabberd.analysis.wall.forms import Forms, Principal, curvature_per_m, middle_forms, outer_forms
from grabberd.analysis.wall.material import Material, Zone, lacking, wall_at
from grabberd.analysis.wall.material_document import read_zones
from grabberd.analysis.wall.strain import Strain, outer_strain
from grabberd.analysis.wall.target_strain import (
    EdgeStrain,
    Places,
    TriangleStrain,
    edge_strain,
    nominal_places,
    outer_places,
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
