"""The operator's page in a real browser. A package, so that fixtures can live as long as its tests run."""
