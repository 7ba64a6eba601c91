"""From points to shape, strain, tension and pressure (paper 3.8)."""

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.compression.touch import Touch, first_touch
from grabberd_liner.analysis.load.load_prior import Difference
from grabberd_liner.analysis.load.middle_surface import MiddleSurface
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureMap
from grabberd_liner.analysis.load.pressure_model import UNSEEN, PressureModel, SettledWall
from grabberd_liner.analysis.load.ramp.collapse import Collapse, collapse
from grabberd_liner.analysis.load.ramp.empty_ramp import LinerValues, liner_values
from grabberd_liner.analysis.load.ramp.ramp_levels import RampLevel
from grabberd_liner.analysis.pulsation.movement import Movement, TimedPoints, first_movement
from grabberd_liner.analysis.pulsation.phase_average import PhaseAverage, phase_average
from grabberd_liner.analysis.pulsation.phases import Phases, iso_phases, wall_phases
from grabberd_liner.analysis.pulsation.pulsation import Pulsation, fit_pulsation
from grabberd_liner.analysis.pulsation.variation import Variation, variation
from grabberd_liner.analysis.pulsation.waveform import Waveform
from grabberd_liner.analysis.surface.area import Area, surface_area
from grabberd_liner.analysis.surface.face import Face, supported_places
from grabberd_liner.analysis.surface.fitting import choose_smoothing, fit_surface, left_out_problems, possible
from grabberd_liner.analysis.surface.free_surface import Height, Tube, fit_free_surface, free_shape
from grabberd_liner.analysis.surface.jets import ORDERS, Jets, index
from grabberd_liner.analysis.surface.mesh import PER_PITCH, Mesh, middles
from grabberd_liner.analysis.surface.outlines import Plane
from grabberd_liner.analysis.surface.sections import Section, section, sections, symmetry_plane, volume_mm3
from grabberd_liner.analysis.surface.smoothing import Smoothing
from grabberd_liner.analysis.surface.surface import Surface, propagate
from grabberd_liner.analysis.vacuum.vacuum import ConstantVacuum, LoggedVacuum, PulsatorWave, VacuumSource
from grabberd_liner.analysis.vacuum.vacuum_log import VacuumLog, read_vacuum_log
from grabberd_liner.analysis.vacuum.vacuum_offset import Offset, WallLag, find_offset
from grabberd_liner.analysis.view.camera import Camera, viewing_axes
from grabberd_liner.analysis.view.ray_casting import Hits, Raster, cast
from grabberd_liner.analysis.view.registration import Agreement, agreement
from grabberd_liner.analysis.view.synthetic import SyntheticView, grey_at, synthetic_view
from grabberd_liner.analysis.wall.forms import Forms, Principal, curvature_per_m, middle_forms, outer_forms
from grabberd_liner.analysis.wall.material import Material, Zone, lacking, wall_at
from grabberd_liner.analysis.wall.material_document import read_zones
from grabberd_liner.analysis.wall.strain import Strain, outer_strain
from grabberd_liner.analysis.wall.target_strain import (
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
