"""One TOML file, frozen and typed."""
