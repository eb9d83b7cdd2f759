"""Names of the core that were in deeptruck_model work for one more release."""

from deeptruck_core import errors, signals
from deeptruck_model import errors as earlier_errors
from deeptruck_model import signals as earlier_signals


def test_earlier_names_are_the_same_objects() -> None:
    assert earlier_errors.InputError is errors.InputError
    assert earlier_signals.CHANNELS is signals.CHANNELS
    assert earlier_signals.TruckInterface is signals.TruckInterface
