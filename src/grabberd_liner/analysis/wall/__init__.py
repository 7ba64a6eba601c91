"""The liner's wall: strain, material, tension, bending, equilibrium."""
