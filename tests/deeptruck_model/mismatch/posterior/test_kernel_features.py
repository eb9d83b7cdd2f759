"""What kernels say of residuals, as the features of a classifier."""

from __future__ import annotations

import numpy as np

from deeptruck_model.mismatch.posterior.kernel_features import FURTHEST, TEMPERATURE, Seen


def test_the_sign_counts_in_units_between_its_bounds() -> None:
    """Of four residuals by one kernel; so few nats are worth a unit of TEMPERATURE."""
    sign = TEMPERATURE * np.array([[-100.0, -2.0, 0.5, 100.0]])
    one = np.ones((1, 4))
    seen = Seen(one, sign, np.zeros((1, 4), dtype=np.intp), one, one[0])
    features = seen.features([0], [0], 1)
    np.testing.assert_allclose(features[2], [-FURTHEST, -2.0, 0.5, 2.0])
