"""How well recordings are foreseen that no network has seen: fit, test, and what follows from the tests."""
