"""Pictures of models and views (paper 3.7): wire models, shaded surfaces, synthetic views.

Arrays in, pictures out; `command` and `from_capture` alone read captures and write files.
"""
