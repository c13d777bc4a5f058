"""Viewer in the browser, and motions as self-contained HTML files."""

from gauss.errors import extra

with extra("view"):
    from gauss.view.viewer.film import export_film
    from gauss.view.viewer.show import Page, Viewer, export_html, page, show

__all__ = ["Page", "Viewer", "export_film", "export_html", "page", "show"]
