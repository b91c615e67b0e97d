"""One trial with and without help: traces, film, figure, and `surefoot demo`."""
