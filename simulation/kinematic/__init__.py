"""A kinematic person who walks, stumbles, sits and falls, seen by a virtual camera and a noisy detector."""
