"""Report of an evaluation as one HTML file: contents, charts, pictures and the page."""
