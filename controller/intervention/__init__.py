"""From fall-state horizon to stiffening profile and supervisor state."""
