"""The liner science: shape, strain, tension and pressure on the teat, from what an instrument has kept.

`analysis` holds the formulas and `chain` strings them together, both pure; `analyses`, `guided_tests`,
`studies` and `profiles` have all that a daemon, a command and a report need of one noun, from its documents
to its routes; `render` draws.
"""
