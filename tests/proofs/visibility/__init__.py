"""What a view truly sees of the discs on a closing wall, and how much of that a locator finds."""
