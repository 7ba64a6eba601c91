"""Correspondence: identification of the blobs of both views as targets of the object (paper 3.7).

`agreement` lists the hypotheses that rays and object model allow, and finds the largest set that fits
together; `displacement_field` (in parts: `TiledField`) predicts each target from the others; `correspondence`
combines them, by the compiled kernel (`compiled_identification`, `compiled_search`) or numpy, and finds the
blobs near where targets must be, also of those that one view alone sees.
"""
