"""Exact clearance, footprints, and the motions that are free, on maps and curves, by the kernels; the audit uses none of it."""
