"""Horizon, wrench and odometry -> base and support command."""
