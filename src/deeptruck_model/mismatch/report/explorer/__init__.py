"""The part of the page that engineers work with: linked views of the drives, drawn by a script in the page.

In comes what was found; out goes one JSON text of rounded block means (`data`) with the curve of each finding
(`curves`). Beside them lie the scripts and styles that the page holds: nothing is fetched.
"""

from deeptruck_model.mismatch.report.explorer.assets import dark, script, style
from deeptruck_model.mismatch.report.explorer.data import of, text

__all__ = ["dark", "of", "script", "style", "text"]
