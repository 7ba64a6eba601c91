"""Correspondence: identification of the blobs of both views as targets of the object (paper 3.7).

`hypotheses` lists what rays and object model allow, `displacement_field` (in parts: `tiled_field`) predicts
each target from the others, `agreement` finds the largest set of hypotheses that fit together, `prediction`
finds blobs near where targets must be; `correspondence` combines them, by the compiled kernel
(`compiled_identification`, `compiled_search`) or numpy. `single_view_search` identifies the blobs of targets
that one view alone sees.
"""
