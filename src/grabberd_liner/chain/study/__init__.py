"""A study of many analysed captures: their quantities side by side, groups compared, trends."""
