"""How Sphinx builds the site; `docs/build.py` assembles the pages and runs it."""

from __future__ import annotations

import pkgutil
import re
from importlib import import_module

from docutils import nodes
from docutils.utils.math import latex2mathml

import picchio

# Autodoc changes annotations of base classes: classes made after that fail to build on them.
for info in pkgutil.walk_packages(picchio.__path__, "picchio."):
    import_module(info.name)

project = "picchio"
author = "The picchio developers"
release = picchio.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]

html_theme = "furo"
html_title = f"picchio {release}"
html_theme_options = {"top_of_page_buttons": []}
html_math_renderer = "mathml"  # drawn by the browser: no script, no network
html_show_sphinx = False
html_copy_source = False
smartquotes = False

nb_execution_mode = "off"  # the tests execute the notebooks
myst_enable_extensions = ["dollarmath", "attrs_inline"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_custom_sections = [("Options", "params_style")]  # of commands
default_role = "code"
python_use_unqualified_type_names = True
# What `import picchio` gives stands twice, there and in its stage: a link may lead to either.
suppress_warnings = ["ref.python"]

_CODE = re.compile(r"(`[^`]*`)")


def plain_text(app, what, name, obj, options, lines):
    """Docstrings are plain text with `code` and fenced blocks: RST shall read no more into it."""
    fenced = False
    made = []
    for line in lines:
        if line.lstrip().startswith("```"):
            indent = line[: len(line) - len(line.lstrip())]
            fenced = not fenced
            if fenced:
                made += ["", f"{indent}.. code-block:: {line.strip()[3:] or 'text'}", ""]
            else:
                made.append("")
            continue
        if fenced:
            made.append(f"    {line}")
        elif line.lstrip().startswith((">>>", "...", "*args", "**")):
            made.append(line)
        else:
            parts = _CODE.split(line)
            parts[::2] = [re.sub(r"([*|])|(?<=\w)_(?!\w)", r"\\\g<0>", part) for part in parts[::2]]
            made.append("".join(parts))
    lines[:] = made


def _math(self, node):
    block = isinstance(node, nodes.math_block)
    self.body.append(latex2mathml.tex2mathml(node.astext(), as_block=block))
    raise nodes.SkipNode


def setup(app):
    """Connect the two."""
    app.connect("autodoc-process-docstring", plain_text, priority=400)
    app.add_html_math_renderer(
        "mathml", inline_renderers=(_math, None), block_renderers=(_math, None)
    )
