"""Studies: captures found with their analyses in folders or an archive, compared, exported and reported."""
