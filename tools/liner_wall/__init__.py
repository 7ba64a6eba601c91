"""A liner's wall in equilibrium: a thick rubber tube under pressure, closing on a compliant teat.

It provides what the simulated grabber shows and knows the truth of. So it is a solid, cut into bricks through
the wall, with pressure on its real faces, and shares no equation with `grabberd_liner.analysis`: what that
estimates can be judged by what this computes.

    rubber        stress from deformation
    mesh          bricks, their shape functions, the tube's faces
    slabs         linear equations of a tube
    teat          what the wall closes on
    equilibrium   Newton's method for a state under pressure
    path          states as the pressure rises or falls, through snap-through
    designs       liners and teats
"""
