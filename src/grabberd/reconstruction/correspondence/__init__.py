"""Which blobs of both views are which target (paper 3.7): hypotheses, their agreement, and the decision."""
