"""A kernel with V4L2 cards, as a model: what it answers follows from the state that it is in.

`FakeKernel` makes the system calls on a clock that jumps; a `Card` is a driver with its hardware, camera
included; a `Camera` has progressive pictures;
`pictures` are what the camera sees, their field's number and parity in the pixels.
"""

from drivers.v4l2.fake_kernel.camera import Camera
from drivers.v4l2.fake_kernel.card import Card
from drivers.v4l2.fake_kernel.kernel import FakeKernel
from drivers.v4l2.fake_kernel.pictures import field_picture, number_in, number_in_blocks, whole_picture

__all__ = ["Camera", "Card", "FakeKernel", "field_picture", "number_in", "number_in_blocks", "whole_picture"]
