"""The pressure of the liner on the teat."""
