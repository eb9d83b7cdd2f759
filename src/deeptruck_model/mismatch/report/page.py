"""The page: report.html in one file that opens offline, its figures as PNG beside it."""

from __future__ import annotations

import base64
from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from deeptruck_model import pages
from deeptruck_model.mismatch.fit_result import Chosen, FitResult
from deeptruck_model.mismatch.report import explorer, figures, given, headline, validation, what_now, wording
from deeptruck_model.mismatch.report import text as page_text
from deeptruck_model.mismatch.report.drawing import words
from deeptruck_model.mismatch.report.given import record_next, untested
from deeptruck_model.mismatch.report.identifiability import most_tried
from deeptruck_model.mismatch.report.what_now import Asked
from deeptruck_model.mismatch.result import ALWAYS, RARELY, Mismatch, SmallestVisible

TEMPLATE = "report.html.jinja"
ROWS = {  # of the table before and after
    "before": "before: as it was given",
    "parameters_only": "parameters only: all refitted, nothing else",
    "after": "after: corrected by the findings",
    "free_model": "free model: corrected by laws without a name too",
}
SCALED = "forces only: all scaled, as the simulator has no parameters"
ALONE = "after: all parameters refitted, no name, as these drove the fitted recordings best"


def write(mismatch: Mismatch, out: Path, asked: Asked) -> None:
    """Write report.html and the figures (PNG, coverage.png among them) into the folder `out`, which exists.

    `asked` is the call that the page's commands repeat. Raises OSError where the folder cannot be written.
    """
    drawn = figures.draw(mismatch)
    for name, picture in drawn.items():
        (out / f"{name}.png").write_bytes(picture.png)
    (out / "report.html").write_text(page(mismatch, drawn, asked), encoding="utf-8")


def page(mismatch: Mismatch, drawn: dict[str, figures.Picture], asked: Asked) -> str:
    """The page as HTML. Nothing in it is fetched from elsewhere."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(_file(TEMPLATE)).render(_content(mismatch, drawn, asked))


def _file(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _content(m: Mismatch, drawn: dict[str, figures.Picture], asked: Asked) -> dict[str, Any]:
    v = m.result
    gained, nothing = page_text.rejected_names(m)
    first, *more = headline.sentences(headline.of(v))
    to_drive = record_next(m)
    views = explorer.of(m)
    return {
        "style": pages.shared(pages.STYLE) + explorer.style() + pages.shared(pages.DARK) + explorer.dark(),
        "script": explorer.script(),
        "views": views,
        "drives": explorer.text(views),
        "sentence": first,
        "verdict": more,
        "now": what_now.steps(m, to_drive, asked),
        "summary": given.summary(m),
        "findings": page_text.findings(m),
        "smallest": smallest(v.data.smallest_visible),
        "figures": {name: _embedded(picture) for name, picture in drawn.items()},
        "regimes": [
            {
                "where": wording.condition(r),
                "error": wording.percent(r.share_of_error),
                "time": wording.percent(r.share_of_time),
            }
            for r in v.regimes
        ],
        "fit": _fit(v.fit),
        "gained": gained,
        "nothing": nothing,
        "suspicions": page_text.suspicions(m.result),
        "samples": [{"rule": wording.prose(r.rule), "samples": r.samples} for r in v.data.rejected],
        "next": [*to_drive, *untested(m)],
        "caveats": [wording.opened(wording.prose(c)) for c in given.caveats(v)],
    }


def _embedded(picture: figures.Picture) -> dict[str, Any]:
    parts = [base64.b64encode(part).decode("ascii") for part in picture.parts or (picture.png,)]
    return {"sources": [f"data:image/png;base64,{part}" for part in parts], "caption": picture.caption}


def smallest(seen: SmallestVisible | None) -> list[dict[str, str]]:
    """The table of what would have been seen."""
    if seen is None:
        return []
    parameters = [{"name": words(n), "size": _relative(n, size)} for n, size in seen.parameters.items()]
    forces = ((ALWAYS, seen.always), (RARELY, seen.rarely))
    return [*parameters, *({"name": name, "size": wording.force(x, seen.mass_kg)} for name, x in forces)]


def _relative(parameter: str, size: float) -> str:
    """A relative size; the largest that was tried may not have been seen either."""
    percent = f"{100 * size:.{0 if size >= 0.1 else 1}f} %"
    return f"more than {percent}; larger ones were not tried" if size >= most_tried(parameter) else percent


def _fit(fit: FitResult | None) -> dict[str, Any] | None:
    """The before/after table; None where there was no free run to compare."""
    if fit is None or fit.errors is None:
        return None
    names = ROWS | ({"after": ALONE} if fit.chosen is Chosen.PARAMETERS else {})
    names |= {"parameters_only": SCALED} if fit.scales_forces else {}
    rows = [
        {
            "name": names[name],
            "speed": wording.number(rmse.speed),
            "acceleration": wording.number(rmse.acceleration),
        }
        for name, rmse in fit.errors.each().items()
    ]
    return {
        "rows": rows,
        "runs": wording.counted(fit.windows, "free run"),
        "horizon": wording.number(fit.horizon_s),
        "held_out": ", ".join(fit.held_out),
        "said": validation.said(fit),
    }
