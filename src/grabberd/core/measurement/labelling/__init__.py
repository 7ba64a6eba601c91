"""Labelling (paper 3.5): from packed bits to connected components.

`mask` compares packed planes with the threshold, `runs` finds runs of set pixels without unpacking them,
`labels` joins touching runs to components, `shapes` sums each component up to a size, an extent and a centre.
"""
