"""Settings files (TOML): keys, reading, problems, description and editing."""
