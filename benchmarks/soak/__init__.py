"""The soak: the whole system for a long time at ten times the usual rates."""
