"""From packed bits to labelled components (paper 3.5): runs, labels, masks, shapes."""
