"""The robots on own pins that ship."""
