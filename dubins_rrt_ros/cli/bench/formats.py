"""The report of `dubins_rrt bench` in files: Markdown, CSV for a spreadsheet and LaTeX for a paper, by the ending of the name."""

import csv
import io
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..common.output import finite
from .records import Best, Runs
from .report import EXPLANATION, TITLE, Section, sections, to_document, to_markdown

#: Maximum number of planners in a table in LaTeX: with the names of the figures, what a text of 12 cm takes.
COLUMNS = 3
_LATEX = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
          **{character: f"\\{character}" for character in "&%$#_{}"}}


def write_report(file: str, runs: Runs, best: Mapping[str, Best]) -> None:
    """Write the report as CSV to a file that ends with .csv, as LaTeX to one that ends with .tex, else in Markdown."""
    write = {".csv": to_csv, ".tex": to_latex}.get(Path(file).suffix.lower(), to_markdown)
    Path(file).write_text(write(runs, best), encoding="utf-8")


def to_csv(runs: Runs, best: Mapping[str, Best]) -> str:
    """Write a row for each problem and planner, with the figures and the names of the JSON [s, m]; infinite ones are empty."""
    rows = [dict(_flat("", result)) for result in finite(to_document(runs, best)["results"])]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the figures of nested dictionaries, their names joined."""
    if not isinstance(value, dict):
        yield name, value
        return
    for key, inner in value.items():
        yield from _flat(f"{name}_{key}" if name else key, inner)


def to_latex(runs: Runs, best: Mapping[str, Best]) -> str:
    """Write the tables of the report in LaTeX, for the package booktabs."""
    comments = [f"% {line}" for line in f"{TITLE}; needs \\usepackage{{booktabs}}.\n{EXPLANATION}".splitlines()]
    return "\n".join([*comments, *(table for section in sections(runs, best) for table in _latex_tables(section))]) + "\n"


def _latex_tables(section: Section) -> Iterator[str]:
    """Yield a section's table with a column for each planner, as pages are narrow, in parts of a few columns."""
    names, *rows = zip(section.head, *section.rows, strict=True)
    caption = f"{section.title}. {section.text.replace('**', '')}"  # bold in Markdown
    for first in range(1, len(names), COLUMNS):
        head, *lines = (" & ".join(map(_escaped, (row[0], *row[first:first + COLUMNS]))) + r" \\" for row in (names, *rows))
        yield "\n".join([
            r"\begin{table}", r"\centering", r"\small", rf"\caption{{{_escaped(caption if first == 1 else section.title)}}}",
            rf"\begin{{tabular}}{{l{'r' * len(names[first:first + COLUMNS])}}}", r"\toprule", head, r"\midrule", *lines,
            r"\bottomrule", r"\end{tabular}", r"\end{table}"])


def _escaped(text: str) -> str:
    return re.sub(r"[\\~^&%$#_{}]", lambda found: _LATEX[found[0]], text)
