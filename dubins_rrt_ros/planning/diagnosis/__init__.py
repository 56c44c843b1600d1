"""Why there is no path, in sentences with figures."""
