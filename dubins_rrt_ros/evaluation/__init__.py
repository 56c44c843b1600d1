"""The planner measured and judged, by the library and the commands: what a robot need not install. Nothing imports it."""
