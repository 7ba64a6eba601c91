"""Local fields: smooth displacements of a view's picture that the global model does not explain.

`collocation` separates them from trend, target errors and noise, `component_search` finds the size of each by
likelihood, `local_field_trial` accepts them only if they predict held-out targets better
(docs/decisions/0005).
"""
