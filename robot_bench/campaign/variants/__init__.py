"""Variants that judge: of a firmware, to judge goals; of a failing trial, to find what of it matters."""
