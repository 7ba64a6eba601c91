"""Pictures of models and views (paper 3.7): wire models, shaded surfaces, synthetic views. Pure: arrays in,
pictures out.
"""
