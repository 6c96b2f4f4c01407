"""Levels of pins over time: files of waveforms written and read, and a capture of a board laid beside a run."""
