"""The toy trucks of the rooms whose functions the experiments call."""

from tests.deeptruck_cacc.conftest import quick_exam
from tests.deeptruck_model.deep.conftest import drive, truck

__all__ = ["drive", "quick_exam", "truck"]
