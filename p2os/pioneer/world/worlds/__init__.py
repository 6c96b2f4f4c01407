"""Worlds, one TOML file each."""
