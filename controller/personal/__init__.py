"""Virtual mass and damping to one person's liking, learnt from comparisons."""
