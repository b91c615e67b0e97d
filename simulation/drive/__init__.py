"""A drive without a robot: integrates the gated command, publishes odometry and wrench."""
