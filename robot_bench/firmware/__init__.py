"""The example programs for the BluePill: C sources, the ELFs built from them, and the builder."""
