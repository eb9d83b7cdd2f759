"""What to do with a verdict: steps with the commands to copy. Terminal and page show the same ones."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path

from deeptruck_model.checks import Clock
from deeptruck_model.mismatch.report.validation import unnamed_would_help
from deeptruck_model.mismatch.result import Conclusion, Mismatch

NEW_DRIVE = "NEW_DRIVE"
PLACE = "place"
TAKE_OVER = "Take the corrected simulator over:"
TAKE_OVER_BY_PLACE = (
    "The road has it and not the truck: road.csv tells where. The corrected simulator acts by it where it is "
    "told its place:"
)
AS_IT_IS = "Use the simulator as it is: on such driving nothing is missing that these drives could show."


@dataclass(frozen=True)
class Asked:
    """A call of the tool as it was typed, to be repeated; empty where it was called from Python."""

    out: Path
    simulator: str = ""
    recordings: tuple[Path, ...] = ()
    held_out: tuple[Path, ...] = ()
    topic_map: Path | None = None
    mass_kg: float | None = None
    clock: Clock | None = None
    msg: tuple[Path, ...] = ()

    def command(self, *, ending: str, more: tuple[str, ...] = ()) -> str:
        """The call again, with `more` at its end, into a new folder whose name ends on `ending`."""
        if not self.simulator:
            return ""
        fitted = [path for path in dict.fromkeys(self.recordings) if path not in self.held_out]
        alone = set(fitted) <= {Path(NEW_DRIVE)}  # all that was given is held out too: it judges nothing
        held = () if alone or not self.held_out else ("--held-out", *map(str, dict.fromkeys(self.held_out)))
        by_map = ("--topic-map", str(self.topic_map)) if self.topic_map else ()
        timing = ("--clock", self.clock) if self.clock else ()
        defining = tuple(word for file in self.msg for word in ("--msg", str(file)))
        weighing = ("--mass-kg", f"{self.mass_kg:g}") if self.mass_kg else ()
        words = (
            "--simulator",
            self.simulator,
            "--recordings",
            *map(str, dict.fromkeys(self.recordings) if alone else fitted),
            *held,
            *by_map,
            *timing,
            *defining,
            *weighing,
            *more,
        )
        return _line("mismatch", *words, "--out", beside(self.out, ending))


@dataclass(frozen=True)
class Step:
    """Something to do, and the command that does it where there is one."""

    says: str
    command: str = ""


def beside(out: Path, ending: str) -> str:
    """A folder for what follows from the one in `out`."""
    return str(out.with_name(f"{out.resolve().name}_{ending}"))


def steps(found: Mismatch, drive_next: list[str], asked: Asked) -> list[Step]:
    """What to do now, most useful first. `drive_next` says what to record, most useful first."""
    verdict = found.result
    out = [Step(AS_IT_IS)] if verdict.kind is Conclusion.NOTHING else []
    if verdict.validated:
        better = _line("apply", str(asked.out), "--out", beside(asked.out, "corrected"))
        out.append(Step(TAKE_OVER_BY_PLACE if _needs_its_place(found) else TAKE_OVER, better))
    if asked.recordings and _has_a_road(found):
        given = map(str, dict.fromkeys((*asked.recordings, *asked.held_out)))
        graded = _line("road", str(asked.out), *given, "--out", beside(asked.out, "with_road"))
        out.append(
            Step("A slope belongs to its road and not to the truck; put it into the recordings:", graded)
        )
    if verdict.findings and unnamed_would_help(verdict.fit):
        again = asked.command(ending="with_laws", more=("--with-unnamed",))
        out.append(Step("Put laws for what has no name into the correction too:", again))
    if drive_next:
        out.append(Step(drive_next[0]))
        with_new = replace(asked, recordings=(*asked.recordings, Path(NEW_DRIVE)))
        again = with_new.command(ending="again")
        out += [Step("Then compare again, with the new recording among the others:", again)] if again else []
    return out


def _needs_its_place(found: Mismatch) -> bool:
    """Whether the correction belongs to places on the road, and is nothing without them."""
    fit = found.result.fit
    return fit is not None and fit.handed_over is not None and PLACE in fit.handed_over.without


def _has_a_road(found: Mismatch) -> bool:
    """Whether a slope was found that was not recorded."""
    road = any(f.effect == "road_grade" and f.cause is not None for f in found.result.findings)
    return road and found.evidence is not None and not found.evidence.has("grade")


def _line(*words: str) -> str:
    return shlex.join(("deeptruck-model", *words))
