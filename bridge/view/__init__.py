"""Looking at a running system, or at a recording of one, in Rerun. Listens only."""
