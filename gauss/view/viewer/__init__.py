"""Viewer in the browser, and motions as self-contained HTML files."""

from gauss.view.viewer.show import export_html, show

__all__ = ["export_html", "show"]
