"""A recording: named channels with units on one uniform clock, without gaps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from deeptruck_core.account import Account
from deeptruck_core.arrays import Array
from deeptruck_core.errors import InputError
from deeptruck_core.signals import TruckInterface, printed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TABLE_NOTE = "imported from the table "  # begins the note of a recording that was imported from one
FROM_SPEED = "acceleration derived from speed"
STEPPED = ("engine_command", "brake_command", "gear")  # drawn until the next sample


@dataclass(frozen=True, repr=False)
class Recording:
    """One contiguous drive. Every channel has shape (n,); NaN marks an invalid or missing sample.

    `name` is the bag's name, followed by '#k' for the k-th contiguous piece if the bag has several. `start_s`
    is the time of the first sample since the start of the bag, `dt` the sample period in s. Channels absent
    from the source are absent from `channels`, except speed and acceleration, which are always there.
    `obeyed` says that the commands are known to have driven the truck, or to be the driver's.
    `no_vehicle_ahead` is the user's statement that no vehicle was near enough for its wake to matter.
    """

    name: str
    dt: float
    channels: dict[str, Array]
    interface: TruckInterface
    start_s: float = 0.0
    notes: tuple[str, ...] = field(default=())  # what extraction did: derived channels, rejected samples
    account: Account | None = field(default=None, compare=False)  # of the bag, log or table it came from
    obeyed: bool = False
    no_vehicle_ahead: bool = False

    def __len__(self) -> int:
        return len(self.channels["speed"])

    def __repr__(self) -> str:
        """A one-line summary, for notebooks that show many recordings."""
        length = f"{self.dt * len(self):.1f} s at {1 / self.dt:g} Hz"
        return f"<Recording {self.name!r}: {length}; {', '.join(self.channels)}; {self.interface.summary}>"

    @property
    def from_table(self) -> bool:
        """Whether the recording was imported from a table, so that its channels are columns."""
        return any(note.startswith(TABLE_NOTE) for note in self.notes)

    @property
    def time(self) -> Array:
        """Seconds since the start of the bag, (n,)."""
        return self.start_s + self.dt * np.arange(len(self), dtype=np.float64)

    def columns(self, names: tuple[str, ...]) -> Array:
        """The named channels as columns, (n, len(names)). Raises InputError if one is missing."""
        missing = [name for name in names if name not in self.channels]
        if missing:
            raise InputError(f"recording '{self.name}' has no channel {', '.join(missing)}")
        if not names:
            return np.zeros((len(self), 0))
        return np.stack([self.channels[name] for name in names], axis=1)

    @property
    def u(self) -> Array:
        """Controllable inputs (n, n_u), held from sample k to k+1."""
        return self.columns(self.interface.u)

    @property
    def w(self) -> Array:
        """Uncontrollable conditions (n, n_w)."""
        return self.columns(self.interface.w)

    @property
    def y(self) -> Array:
        """Responses (n, n_y)."""
        return self.columns(self.interface.y)

    def plot(self, *names: str) -> Figure:
        """A figure of the named channels over time, all channels by default; `.savefig(path)` writes it.

        Raises InputError for an unknown channel.
        """
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        names = names or tuple(self.channels)
        columns = self.columns(names).T.astype(np.float32)  # hides the rounding noise of a constant
        figure = Figure(figsize=(10, 0.8 + 1.3 * len(names)), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
        for ax, name, values in zip(axes, names, columns, strict=True):
            ax.plot(self.time, values, lw=1.0, drawstyle="steps-post" if name in STEPPED else "default")
            label, unit = name.replace("_", " "), self.interface.unit(name)
            label = label if unit == "1" else f"{label}\n[{printed(unit)}]"
            ax.set_ylabel(label, rotation=0, ha="right", va="center")
            ax.ticklabel_format(axis="y", useOffset=False)
            ax.grid(alpha=0.3)
        axes[-1].set_xlabel("time [s]")
        figure.suptitle(f"{self.name}, {self.interface.summary}")
        return figure

    def gap_after(self, before: Recording | None) -> float | None:
        """Seconds that are lost between `before` and this piece; None if `before` is not a piece of the
        same bag."""
        if before is None or before.name.partition("#")[0] != self.name.partition("#")[0]:
            return None
        return self.start_s - before.start_s - (len(before) - 1) * before.dt

    def piece(self, start: int, stop: int) -> Recording:
        """Samples start..stop as a separate recording."""
        cut = {name: values[start:stop] for name, values in self.channels.items()}
        return replace(self, channels=cut, start_s=self.start_s + start * self.dt)
