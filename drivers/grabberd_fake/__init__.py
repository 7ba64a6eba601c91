"""The simulated grabber: a camera behind mirrors that looks at a simulated scene (driver `fake`).

It has its own optics: one real camera with a lens, and plane mirrors by reflection. So it provides the truth
of what it shows, in space and in the picture, and shares no formula with the program that measures it. The
world runs on an injectable clock; noise, jitter and rig follow from seeds; faults follow a script.

    FakeGrabber(**options)                      the driver; `FakeOptions` lists the options
    truth_at(options, time_ns) -> Truth         truth of the targets at a field's time
    truth_of_wall(options, time_ns)             truth of the liner's wall: strain, tension, pressure
    python -m grabberd_fake calibration         its exact calibration, in the program's own format
    python -m grabberd_fake object SCENE        the object model of a scene
    python -m grabberd_fake truth CAPTURE.grab  the targets' true places at every field of a capture, as CSV
                                                (--of wall: strain to pressure; --of vacuum: a logger's file)
"""

from grabberd_fake.faults import KINDS
from grabberd_fake.grabber import Clock, FakeGrabber, JumpingClock, RealClock
from grabberd_fake.options import SCENES, FakeOptions
from grabberd_fake.stamp import Stamp, read_stamp
from grabberd_fake.truth import truth_at
from grabberd_fake.wall_truth import WallTruth, truth_of_wall
from grabberd_fake.world import Truth, World

NOT_SIMULATED = """\
Self-occlusion (a target is seen wherever it faces a view and the grazing limit allows), partly covered
targets, a target's brightness by angle or distance, stray light and reflections, mirror edges and the light
that a mirror loses, depth of field, vignetting, the glass plate, rolling or half-open shutters, charge smear,
colour, sub-carrier and comb artefacts, ringing and DC restoration of the video signal, a sampling clock that
drifts, fixed-pattern noise, noise that grows with the light or is correlated between pixels, the teat, and a
liner that moves otherwise than by flattening. Discs of more than 40 pixels are left out of the picture.
The liner's movement is prescribed and ignores its loads: there is no contact with a teat. The pressure
p_contact of its truth is what equilibrium across the wall demands of the movement, also suction, and tens of
kPa where it bends sharply; along the wall the movement asks for friction that nothing gives. The wall is
thin, elastic without losses and the same everywhere; the vacuum has straight slopes and no ripple.
"""
"""Effects that this driver leaves out; a test that passes on it says nothing about these."""

__all__ = [
    "KINDS",
    "NOT_SIMULATED",
    "SCENES",
    "Clock",
    "FakeGrabber",
    "FakeOptions",
    "JumpingClock",
    "RealClock",
    "Stamp",
    "Truth",
    "WallTruth",
    "World",
    "read_stamp",
    "truth_at",
    "truth_of_wall",
]
