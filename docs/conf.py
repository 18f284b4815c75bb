"""How Sphinx builds the book. `make docs` stages the pages below build/docs/source and calls it there."""

import os
import re
import shutil
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]

project = "shapegcode"
author = "shapegcode developers"
copyright = "shapegcode developers, MIT licence"
release = metadata.version("shapegcode")

extensions = [
    "breathe",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["Thumbs.db", "**/.ipynb_checkpoints"]
nitpicky = True
# Public names (shapegcode.X) that a page refers to must exist. Signatures also name types of others, for which there is
# no inventory without a network, and inner ones that nobody exports.
nitpick_ignore_regex = [("py:.*", r"(?!shapegcode\.\w+$).*"), ("cpp:.*", ".*")]

html_theme = "furo"
html_title = f"shapegcode {release}"
html_static_path = ["_static"]
html_css_files = ["book.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0072B2", "color-brand-content": "#0072B2"},
    "dark_css_variables": {"color-brand-primary": "#56B4E9", "color-brand-content": "#56B4E9"},
}
pygments_style = "friendly"
pygments_dark_style = "monokai"

# --- Markdown ---------------------------------------------------------------------------------------------------------
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_inline", "substitution"]
myst_heading_anchors = 4
myst_links_external_new_tab = False
# Every header opens the same namespace, which Breathe declares anew on each page.
suppress_warnings = ["duplicate_declaration.cpp"]
# A block that is only indented is a command line or its output: no language is guessed.
highlight_language = "none"

# --- Notebooks --------------------------------------------------------------------------------------------------------
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "build" / "docs" / "notebooks")
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_execution_show_tb = True
nb_merge_streams = True
nb_execution_in_temp = True
# For the pages on C++: where the library was built, the examples that are built against it, and programs.
os.environ.setdefault("SHAPEGCODE_BUILD", str(ROOT / "build" / "release"))
os.environ["IPYTHONDIR"] = str(ROOT / "build" / "docs" / "ipython")
_start = Path(os.environ["IPYTHONDIR"], "profile_default", "startup", "book.py")
_start.parent.mkdir(parents=True, exist_ok=True)
shutil.copy(ROOT / "docs" / "notebook_start.py", _start)
os.environ["SHAPEGCODE_EXAMPLE"] = str(ROOT / "cpp" / "examples" / "controller_prototype")
os.environ["SHAPEGCODE_CONTROL"] = str(ROOT / "integrations" / "example_control")
os.environ["SHAPEGCODE_PROGRAMS"] = str(ROOT / "tests" / "golden" / "programs")

# --- Python and C++ ---------------------------------------------------------------------------------------------------
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_preserve_defaults = True
autosummary_generate = False
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_use_unqualified_type_names = True
add_module_names = False

breathe_projects = {"shapegcode": str(ROOT / "build" / "docs" / "doxygen" / "xml")}
breathe_default_project = "shapegcode"
breathe_default_members = ("members",)
breathe_show_include = False

# --- Links to the world: `make docs-links` ----------------------------------------------------------------------------
linkcheck_timeout = 20
linkcheck_retries = 1
linkcheck_ignore = [r"https?://localhost.*", r"https?://127\.0\.0\.1.*"]


def _bars(text: str) -> str:
    """A text with `|x|` of mathematics kept from becoming a substitution of reStructuredText."""
    return re.sub(r"(?<![\w`|])\|(?=\S)([^|`]*\S)\|", r"\\|\1\\|", text)


def _plain_bars(_app: object, _what: str, _name: str, _value: object, _options: object, lines: list[str]) -> None:
    lines[:] = "\n".join(map(_bars, lines)).split("\n")


def setup(app: Any) -> None:
    """Sphinx calls this."""
    app.connect("autodoc-process-docstring", _plain_bars, priority=400)
