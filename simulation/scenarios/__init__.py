"""What happens to whom: scenarios as data, and their performance in the simulated world."""
