"""The steps of an analysis, a guided test and a study, over points and channels alone (paper 3.8)."""
