"""An archive of captures re-measured by many processes into a data set."""
