"""What an adjustment is worth: significance, blunders, normality, validation, acceptance."""
