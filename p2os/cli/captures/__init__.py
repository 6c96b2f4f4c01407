"""Verbs for recorded conversations: take them, read them, play them, convert them."""
