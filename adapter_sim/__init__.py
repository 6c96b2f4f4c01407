"""The ESP32 adapter between a BluePill and a Pioneer, as a model."""
