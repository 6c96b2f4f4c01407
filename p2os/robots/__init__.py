"""Robot models, one TOML file each."""
