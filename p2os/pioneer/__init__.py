"""The virtual Pioneer: its controller, its body, its sonar, and the worlds it drives in."""
