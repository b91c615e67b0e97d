"""`surefoot tune`: thresholds of `[intervention]` against recorded falls and recorded daily life."""
