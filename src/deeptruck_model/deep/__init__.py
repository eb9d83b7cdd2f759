"""The deep truck: the paper's network, its training, evaluation and simulator directory."""

from typing import TYPE_CHECKING

from deeptruck_core.imports import lazy

if TYPE_CHECKING:
    from deeptruck_model.deep.arguments import Arguments
    from deeptruck_model.deep.evaluation import Trials, statistics, trials
    from deeptruck_model.deep.network import Shape, TruckNetwork
    from deeptruck_model.deep.report import evaluate
    from deeptruck_model.deep.training import finished, train
    from deeptruck_model.deep.truck import DeepState, DeepTruck, Prediction, TorchTruck, load_directory

__all__ = [
    "Arguments",
    "DeepState",
    "DeepTruck",
    "Prediction",
    "Shape",
    "TorchTruck",
    "Trials",
    "TruckNetwork",
    "evaluate",
    "finished",
    "load_directory",
    "statistics",
    "train",
    "trials",
]

__getattr__ = lazy.names(
    __name__,
    {
        "arguments": ("Arguments",),
        "evaluation": ("Trials", "statistics", "trials"),
        "network": ("Shape", "TruckNetwork"),
        "report": ("evaluate",),
        "training": ("finished", "train"),
        "truck": ("DeepState", "DeepTruck", "Prediction", "TorchTruck", "load_directory"),
    },
)
