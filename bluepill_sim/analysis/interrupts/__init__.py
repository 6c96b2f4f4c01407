"""Interrupts of a program: how long they wait, and what depends on when they come."""
