"""Learn the longitudinal dynamics of a truck from its recordings, and find the effects that the model lacks.

    from deeptruck_model import evaluate, find_mismatch, load, mismatch, read, train

    drives = read("drives/monday")                     # list[Recording]
    truck = train(drives, "simulators/mytruck")        # DeepTruck
    evaluate(truck, read("drives/friday"), "evaluation")
    found = find_mismatch(load("truck:trucksim"), drives, read("drives/friday"))
    mismatch.write(found, "found")
    verdict = mismatch.read("found")                   # Verdict

Paths are `str` or `Path`. Each name is loaded at its first use. Bad input raises `errors.InputError`.
"""

from typing import TYPE_CHECKING, Any

from deeptruck_core.imports import lazy

if TYPE_CHECKING:
    from deeptruck_model.deep.report import evaluate
    from deeptruck_model.deep.training import train
    from deeptruck_model.mismatch.find import find_mismatch
    from deeptruck_model.recordings.extract import read
    from deeptruck_model.simulators import MinimalSimulator, Simulator, load

    __version__: str

__all__ = ["MinimalSimulator", "Simulator", "evaluate", "find_mismatch", "load", "read", "train"]

_name = lazy.names(
    __name__,
    {
        "deep.report": ("evaluate",),
        "deep.training": ("train",),
        "mismatch.find": ("find_mismatch",),
        "recordings.extract": ("read",),
        "simulators": ("MinimalSimulator", "Simulator", "load"),
    },
)


def __getattr__(name: str) -> Any:
    """A public name; `__version__` is looked up only on use, because that takes longer than `--help` may."""
    if name == "__version__":
        from importlib.metadata import version

        return version("deeptruck")
    return _name(name)
