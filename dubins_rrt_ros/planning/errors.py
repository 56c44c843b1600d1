"""The base of all errors that the library raises on purpose."""

from .text import one_line


class PlanningError(Exception):
    """An error of the library; the message is for a person, and says what is wrong and where possible what to do.

    It is one line that any terminal can show, whatever of the input is quoted in it.
    """

    def __init__(self, message: str = ""):
        super().__init__(one_line(message))
