"""What is taken home: points, pictures, analyses and data sets in the formats of other programs."""
