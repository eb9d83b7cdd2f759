"""The channels and interfaces of `deeptruck_core.signals`, under the name that they had."""

from deeptruck_core.signals import *  # noqa: F403
