"""A checker of certificates that knows nothing of the planner: `docs/proof.md` has its argument."""
