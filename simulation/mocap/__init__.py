"""Motion capture that drives the person until something happens to them."""
