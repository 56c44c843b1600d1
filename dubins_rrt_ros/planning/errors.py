"""The base of all errors that the library raises on purpose."""


class PlanningError(Exception):
    """An error of the library; the message is for a person, and says what is wrong and where possible what to do."""
