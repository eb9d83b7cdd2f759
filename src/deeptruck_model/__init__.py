"""Learn the longitudinal dynamics of a truck from its recordings, and find what the model leaves out."""

from typing import Any


def __getattr__(name: str) -> Any:
    """`__version__`, when it is asked for: looking it up takes longer than `--help` may."""
    if name == "__version__":
        from importlib.metadata import version

        return version("deeptruck")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
