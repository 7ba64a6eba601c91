"""A study of many captures: groups compared, and trends, by scatter and by what the captures share."""
