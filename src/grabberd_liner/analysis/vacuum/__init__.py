"""The vacuum of pulsation chamber and liner."""
