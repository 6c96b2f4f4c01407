"""The composition root: wires, run loop, scenarios, recordings and reports."""
