"""An evaluation as tables in the terminal, and as a page with pictures."""
