"""The planner measured and judged: what a robot need not install."""
