"""Exact clearance, footprints, and the motions that are free."""
