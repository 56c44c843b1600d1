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
    return "\n".join([*comments, *map(_latex_table, sections(runs, best))]) + "\n"


def _latex_table(section: Section) -> str:
    head, *rows = (" & ".join(map(_escaped, row)) + r" \\" for row in (section.head, *section.rows))
    caption = f"{section.title}. {section.text.replace('**', '')}"  # bold in Markdown
    return "\n".join([r"\begin{table}", r"\centering", rf"\caption{{{_escaped(caption)}}}",
                      rf"\begin{{tabular}}{{l{'r' * (len(section.head) - 1)}}}", r"\toprule", head, r"\midrule", *rows,
                      r"\bottomrule", r"\end{tabular}", r"\end{table}"])


def _escaped(text: str) -> str:
    return re.sub(r"[\\~^&%$#_{}]", lambda found: _LATEX[found[0]], text)
