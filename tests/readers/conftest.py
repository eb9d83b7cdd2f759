from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent  # what makes and damages files stands beside the tests
sys.path += [str(HERE), str(HERE.parent / "deeptruck_model" / "recordings")]
