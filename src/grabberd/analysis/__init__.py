"""From points to shape, strain, tension and pressure (paper 3.8)."""

from grabberd.analysis.area import Area, surface_area
from grabberd.analysis.camera import Camera, viewing_axes
from grabberd.analysis.estimate import Estimate
from grabberd.analysis.fitting import choose_smoothing, fit_surface
from grabberd.analysis.forms import Forms, Principal, curvature_per_m, middle_forms, outer_forms
from grabberd.analysis.free_surface import Height, Tube, fit_free_surface, free_shape
from grabberd.analysis.gaps import Gap, gaps
from grabberd.analysis.grid import Grid
from grabberd.analysis.jets import ORDERS, Jets, index
from grabberd.analysis.material import Material, Zone, lacking, wall_at
from grabberd.analysis.material_document import read_zones
from grabberd.analysis.mesh import PER_PITCH, Mesh, middles
from grabberd.analysis.movement import Movement, TimedPoints, first_movement
from grabberd.analysis.outlines import Plane
from grabberd.analysis.phase_average import PhaseAverage, phase_average
from grabberd.analysis.phases import Phases, iso_phases, wall_phases
from grabberd.analysis.pressure import ChamberVacuum, PressureMap, Shares
from grabberd.analysis.pressure_model import PressureModel
from grabberd.analysis.pulsation import Pulsation, fit_pulsation
from grabberd.analysis.ray_casting import Hits, Raster, cast
from grabberd.analysis.registration import Agreement, agreement
from grabberd.analysis.sections import Section, section, sections, symmetry_plane, volume_mm3
from grabberd.analysis.smoothing import Smoothing
from grabberd.analysis.strain import Strain, middle_strain, outer_strain
from grabberd.analysis.surface import Surface, propagate
from grabberd.analysis.synthetic import SyntheticView, grey_at, synthetic_view
from grabberd.analysis.target_strain import (
    EdgeStrain,
    Places,
    TriangleStrain,
    edge_strain,
    middle_places,
    nominal_middle_places,
    nominal_places,
    outer_places,
    triangle_strain,
)
from grabberd.analysis.tension import Tension, wall_tension
from grabberd.analysis.touch import FreeWall, Touch, above_place, first_touch, free_wall, since_touch
from grabberd.analysis.vacuum import ConstantVacuum, LoggedVacuum, PulsatorWave, VacuumSource
from grabberd.analysis.vacuum_log import VacuumLog, read_vacuum_log
from grabberd.analysis.vacuum_offset import Offset, WallLag, find_offset
from grabberd.analysis.variation import Variation, variation
from grabberd.analysis.waveform import Waveform

__all__ = [
    "ORDERS",
    "PER_PITCH",
    "Agreement",
    "Area",
    "Camera",
    "ChamberVacuum",
    "ConstantVacuum",
    "EdgeStrain",
    "Estimate",
    "Forms",
    "FreeWall",
    "Gap",
    "Grid",
    "Height",
    "Hits",
    "Jets",
    "LoggedVacuum",
    "Material",
    "Mesh",
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
    "Raster",
    "Section",
    "Shares",
    "Smoothing",
    "Strain",
    "Surface",
    "SyntheticView",
    "Tension",
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
    "above_place",
    "agreement",
    "cast",
    "choose_smoothing",
    "curvature_per_m",
    "edge_strain",
    "find_offset",
    "first_movement",
    "first_touch",
    "fit_free_surface",
    "fit_pulsation",
    "fit_surface",
    "free_shape",
    "free_wall",
    "gaps",
    "grey_at",
    "index",
    "iso_phases",
    "lacking",
    "middle_forms",
    "middle_places",
    "middle_strain",
    "middles",
    "nominal_middle_places",
    "nominal_places",
    "outer_forms",
    "outer_places",
    "outer_strain",
    "phase_average",
    "propagate",
    "read_vacuum_log",
    "read_zones",
    "section",
    "sections",
    "since_touch",
    "surface_area",
    "symmetry_plane",
    "synthetic_view",
    "triangle_strain",
    "variation",
    "viewing_axes",
    "volume_mm3",
    "wall_at",
    "wall_phases",
    "wall_tension",
]
