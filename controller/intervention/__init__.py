"""From the fall-state horizon to a decision: risk, stiffening, supervisor. Pure: `now` and messages in, values out."""
