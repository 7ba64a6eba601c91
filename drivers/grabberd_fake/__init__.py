"""The simulated grabber: a camera behind mirrors that looks at a simulated scene (driver `fake`).

It has its own optics: one real camera with a lens, and plane mirrors by reflection. So it provides the truth
of what it shows, in space and in the picture, and shares no formula with the program that measures it. The
world runs on an injectable clock; noise, jitter and rig follow from seeds; faults follow a script.

    FakeGrabber(**options)                      the driver; `FakeOptions` lists the options
    FakeLogger(**options)                       a logger of the same vacuum; see `FakeLoggerOptions`
    FakeLight(**options)                        who switches the lamp in its picture; see `FakeLightOptions`
    truth_at(options, time_ns) -> Truth         truth of the targets at a field's time
    truth_of_liner(options, time_ns)            truth of the liner: strain, contact pressure, load, vacuum
    python -m grabberd_fake calibration         its exact calibration, in the program's own format
    python -m grabberd_fake object SCENE        the object model of a scene
    python -m grabberd_fake truth CAPTURE.grab  the targets' true places at every field of a capture, as CSV
                                                (--of wall: strain and pressure; --of load: N/mm along it;
                                                --of vacuum: a logger's file)
"""

from grabberd_fake.ellipse_truth import WallTruth, truth_of_wall
from grabberd_fake.faults import KINDS
from grabberd_fake.grabber import Clock, FakeGrabber, JumpingClock, RealClock
from grabberd_fake.light_switch import FakeLight, FakeLightOptions
from grabberd_fake.liner_truth import LinerTruth, WallPlaces, truth_of_liner
from grabberd_fake.logger import LOGGER_FAULTS, FakeLogger, FakeLoggerOptions
from grabberd_fake.options import SCENES, FakeOptions
from grabberd_fake.stamp import Stamp, read_stamp
from grabberd_fake.truth import truth_at
from grabberd_fake.world import Truth, World

NOT_SIMULATED = """\
Self-occlusion (a target is seen wherever it faces a view and the grazing limit allows), partly covered
targets, a target's brightness by angle or distance, stray light and reflections, mirror edges and the light
that a mirror loses, depth of field, vignetting, the glass plate, rolling or half-open shutters, charge smear,
colour, sub-carrier and comb artefacts, ringing and DC restoration of the video signal, a sampling clock that
drifts, fixed-pattern noise, and noise that grows with the light or is correlated between pixels. Discs of
more than 40 pixels are left out of the picture.
The liner's wall is in equilibrium at every moment but for a limit of its speed: inertia, damping, heat and
creep of the rubber are left out, and it opens by the states that it closed by. Its teat is a bed of springs
that neither moves nor changes, and no milk flows; its ends are held and do not turn. The rubber is the same
everywhere; the vacuum has straight slopes and no ripple, and none of it depends on the wall.
The logger's sensors have neither a time constant nor a temperature, and its tubes no length; mouthpiece
chamber and milk line have a constant vacuum.
The scene `ellipse` moves as prescribed: there is no teat, and the pressure of its truth is what equilibrium
across the wall would demand of that movement, also suction, and friction that nothing gives.
"""
"""Effects that this driver leaves out; a test that passes on it says nothing about these."""

__all__ = [
    "KINDS",
    "LOGGER_FAULTS",
    "NOT_SIMULATED",
    "SCENES",
    "Clock",
    "FakeGrabber",
    "FakeLight",
    "FakeLightOptions",
    "FakeLogger",
    "FakeLoggerOptions",
    "FakeOptions",
    "JumpingClock",
    "LinerTruth",
    "RealClock",
    "Stamp",
    "Truth",
    "WallPlaces",
    "WallTruth",
    "World",
    "read_stamp",
    "truth_at",
    "truth_of_liner",
    "truth_of_wall",
]
