"""Hundreds of scenarios through the whole stack: no intervention, reactive, anticipatory."""
