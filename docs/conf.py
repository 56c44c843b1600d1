"""Sphinx's configuration for the manual: `sphinx-build -W docs build/manual` builds it. Nothing else reads this file."""

import re

from dubins_rrt_ros import __version__

project = "dubins_rrt_ros"
copyright = "dubins_rrt_ros maintainers; Apache-2.0"  # noqa: A001 - Sphinx's name
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "sphinx_rtd_theme"  # which rosdoc2 has, too
html_static_path, html_css_files = ["_static"], ["manual.css"]
smartquotes_action = "De"  # dashes and dots; quotes in tables are code
html_title = f"dubins_rrt_ros {release}"

# Anchors of headings as GitHub makes them, so that a link works in both places.
myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_typehints = "none"  # the signatures have them, and shapes and units are in the text
# Attributes as a list, like parameters: as entries of their own those of a NamedTuple would be there twice.
napoleon_custom_sections = [("Options", "params_style"), ("Attributes", "params_style")]
napoleon_use_rtype = False
# Docstrings are plain text: single backticks are code, and a star is a star.
default_role = "code"


#: Links from a page to what is no file of the manual: the README, and folders.
OUT_OF_THE_MANUAL = re.compile(r"\[([^\]]+)\]\((?:\.\./)+(?:README\.md[^)]*|examples|launch|config)\)")


def setup(app):
    """Prepare docstrings and pages for Sphinx, which are written to be read without it."""
    app.connect("autodoc-process-docstring", _join_sentence, priority=100)  # before napoleon
    app.connect("autodoc-process-docstring", _escape_stars, priority=900)  # after it
    app.connect("source-read", _unlink)


def _join_sentence(app, what, name, obj, options, lines):
    """Keep napoleon from taking what is before the first colon of a property's docstring for its type."""
    if what in ("property", "attribute", "data"):
        lines[:1] = [line.replace(": ", " -- ", 1) for line in lines[:1]]


def _escape_stars(app, what, name, obj, options, lines):
    lines[:] = [line.replace("RRT*", "RRT\\*").replace("A*", "A\\*") for line in lines]


def _unlink(app, page, source):
    source[0] = OUT_OF_THE_MANUAL.sub(r"\1", source[0])
