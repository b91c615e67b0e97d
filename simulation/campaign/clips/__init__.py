"""Clips of simulated people for training: what the virtual camera saw, and what really happened."""
