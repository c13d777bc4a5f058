"""The documentation: pages in ``pages``, and what is made of the package itself when they are built.

Sphinx with MyST (Markdown), Furo (theme) and sphinx-gallery (examples), all maintained and installed by the extra ``docs``::

    gauss docs --output FOLDER

copies the pages, adds those that are made of the package (:mod:`gauss.cli.docs.generated`,
:mod:`gauss.cli.docs.reference`), runs the examples of ``models/examples`` for the gallery, and writes HTML that needs no
server and no network.
"""
