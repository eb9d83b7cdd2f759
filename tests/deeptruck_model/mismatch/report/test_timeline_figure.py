"""The recordings along time: distinguishable lines, axes that say what they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from found_mismatches import mismatch
from matplotlib.colors import to_rgb

from deeptruck_model.mismatch.report import figures, timeline_figure


def axes():
    made, _, _ = timeline_figure.timeline(mismatch("missing_physics", count=2))
    return made, made.axes


def test_every_axis_says_what_it_is() -> None:
    _, every = axes()
    said = [ax.get_ylabel().replace("\n", " ") for ax in every]
    assert {"speed, m/s", "grade, %", "engine, N m", "brake, percent", "force, kN"} == set(said)
    assert "time, s" in [ax.get_xlabel() for ax in every]


def test_no_two_lines_look_alike_and_the_residual_is_seen_below_what_explains_it() -> None:
    made, every = axes()
    lines = made.legends[0].get_lines()
    tones = [np.array(to_rgb(line.get_color())) for line in lines]
    assert min(np.abs(a - b).max() for k, a in enumerate(tones) for b in tones[:k]) > 0.2
    (force,) = [ax for ax in every if ax.get_ylabel() == "force, kN"][:1]
    residual, explained = [line for line in force.get_lines() if len(line.get_xdata()) > 2]
    assert residual.get_linewidth() > 2 * explained.get_linewidth()


def test_forces_have_one_scale_that_no_spike_sets() -> None:
    """What goes beyond has a mark at the edge."""
    found = mismatch("missing_physics", count=2)
    e = found.evidence
    spiked = e.residual.copy()
    spiked[40:44] += 50.0
    made, _, _ = timeline_figure.timeline(replace(found, evidence=replace(e, residual=spiked)))
    plain, _, _ = timeline_figure.timeline(found)
    panels, without = ([a for a in m.axes if a.get_ylabel() == "force, kN"] for m in (made, plain))
    assert len({p.get_ylim() for p in panels}) == 1
    assert panels[0].get_ylim()[1] < 2.0 * without[0].get_ylim()[1]
    up, down = ([len(x.get_xdata()) for x in panels[0].get_lines() if x.get_marker() == m] for m in "^v")
    assert up[0] > 0 and down == [0]


def test_nothing_is_shaded_where_nothing_is_compared() -> None:
    found = mismatch("missing_physics", count=2)
    e = found.evidence
    valid = e.valid.copy()
    valid[: e.stretches[0].start + 180] = False  # of a segment from 100 to 250
    standing = replace(found, evidence=replace(e, valid=valid))
    ((start, stop, _),) = timeline_figure.tracks(standing)[0].spans
    assert (start, stop) == (180 * e.dt, 250 * e.dt)


def test_the_page_says_why_the_force_has_gaps() -> None:
    assert figures.GAPS in figures.draw(mismatch("missing_physics"))["timeline"].caption
    assert "gaps" not in figures.draw(mismatch("undetermined"))["timeline"].caption
