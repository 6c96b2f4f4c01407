"""Campaigns: many runs of a scenario in which something varies, in search of the worlds in which its firmware fails."""
