"""The reasons why there is no path, in sentences with figures."""
