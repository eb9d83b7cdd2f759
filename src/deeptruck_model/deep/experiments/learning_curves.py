"""Losses against passes over the data, in both forms and by what is fed back, over many seeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure

from deeptruck_model.deep.arguments import PAPER_FUEL
from deeptruck_model.deep.data.scales import Scales
from deeptruck_model.deep.data.windows import Sequences
from deeptruck_model.deep.kernels import loss
from deeptruck_model.deep.network import TruckNetwork
from deeptruck_model.recordings import Recording

COLOURS = {"training": "tab:blue", "deployment": "tab:red"}
STEPS = 100  # K
FED = {"nothing": (), "speed": (1,), "acceleration": (0,), "fuel": (2,), "everything": (0, 1, 2)}


class Unseen:
    """Two drives that no training sees, one for each form, as the paper has it.

    `fuel` is the cost of a squared fuel error of 1 (cm^3/s)^2.
    """

    def __init__(self, forced: Recording, free: Recording, fuel: float = PAPER_FUEL) -> None:
        self.drives, self.fuel = {"training": forced, "deployment": free}, fuel

    def losses(self, network: TruckNetwork) -> dict[str, list[float]]:
        """Plain squared error by form, (members,) each, over windows of K steps from zero state."""
        weight = np.zeros(network.shape.responses + network.shape.taught, np.float32)
        weight[: network.shape.responses] = [1.0, 1.0, self.fuel][: network.shape.responses]
        return {
            form: loss.loss(network, *_windows(network, drive), weight, form).tolist()
            for form, drive in self.drives.items()
        }

    def by_feedback(self, network: TruckNetwork) -> dict[str, list[float]]:
        """Mean squared error of acceleration, speed and fuel on the drive of the deployment form, by which
        recorded responses are fed to the network in place of its own. One member."""
        x, target = _windows(network, self.drives["deployment"])
        width = x.shape[-1]
        inputs = torch.as_tensor(x[0]).transpose(0, 1) * network.scale[:width] + network.mean[:width]
        u, w = inputs[..., : network.shape.controls], inputs[..., network.shape.controls :]
        recorded = torch.as_tensor(target[0]).transpose(0, 1)
        found = {}
        for name, channels in FED.items():
            fed = recorded.clone()
            own = [j for j in range(network.shape.responses) if j not in channels]
            fed[:, 1:, own] = torch.nan
            with torch.no_grad():
                made = network.unfold(u, w, fed, "training")[0, ..., : network.shape.responses]
            found[name] = torch.nanmean((made - recorded[:, 1:]) ** 2, dim=(0, 1)).tolist()
        return found


def _windows(network: TruckNetwork, drive: Recording) -> tuple[Any, Any]:
    scales = Scales(network.mean.numpy(), network.scale.numpy(), network.top_speed)
    starts = np.arange(0, len(drive) - STEPS, STEPS)
    return Sequences.of([drive], scales).gather(np.repeat(starts[None], network.shape.members, axis=0), STEPS)


def figure(curves: Mapping[str, Any]) -> Figure:
    """Both losses over the passes: mean, and the range of the seeds."""
    figure = Figure(figsize=(7, 4), layout="constrained")
    axis, at = figure.subplots(), curves["passes"]
    for form, colour in COLOURS.items():
        losses = np.array(curves[form])
        axis.fill_between(at, losses.min(1), losses.max(1), color=colour, alpha=0.25)
        axis.plot(at, losses.mean(1), color=colour, label=f"{form} form")
    axis.set(xlabel="passes over the training data", ylabel="squared error on an unseen drive", yscale="log")
    seeds = losses.shape[1]
    spread = "one seed" if seeds == 1 else f"mean, min and max of {seeds} seeds"
    axis.set_title(spread, fontsize="small", loc="right")
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize="small", frameon=False)
    return figure
