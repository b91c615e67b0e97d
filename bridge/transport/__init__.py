"""Ways to carry bytes between nodes behind one interface."""
