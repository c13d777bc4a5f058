"""Configuration of Sphinx; read by Sphinx, not imported."""

from gauss.cli.docs import gallery, reference
from gauss.io.catalog import folder
from gauss.versions import VERSION

project = "gauss"
author = "The gauss developers"
copyright = author  # noqa: A001
version = release = VERSION
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["gallery/**/*.ipynb", "gallery/**/*.py", "gallery/**/*.zip"]
# tables of benchmarks begin below the first level; names of fields are no references
suppress_warnings = ["myst.header", "config.cache", "ref.python"]
html_theme = "furo"
html_title = f"gauss {VERSION}"
html_static_path: list[str] = []
html_copy_source = False
html_show_sphinx = False
templates_path: list[str] = []

myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist"]
myst_heading_anchors = 3
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

autodoc_typehints = "none"  # docstrings say types with shapes and units
autodoc_member_order = "bysource"
autoclass_content = "class"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_use_param = False

sphinx_gallery_conf = {
    "examples_dirs": str(folder() / "examples"),
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"__init__\.py$",
    "within_subsection_order": "FileNameSortKey",
    "subsection_order": gallery.of_sections,
    "image_scrapers": (gallery.scraped,),
    "reset_modules": (gallery.reset,),
    "backreferences_dir": None,
    "download_all_examples": False,
    "parallel": True,  # as many processes as Sphinx has
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1_000_000,
    "only_warn_on_example_error": False,
    "abort_on_example_error": False,
    "remove_config_comments": True,
    "thumbnail_size": (320, 224),
}


def setup(app):
    """Resolve references to public names by the objects that they name."""
    reference.setup(app)
