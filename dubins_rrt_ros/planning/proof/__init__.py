"""Proofs that no path is much shorter than the one that was found; the search uses none of it but to end."""
