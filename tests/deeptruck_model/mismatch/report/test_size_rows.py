"""The sizes of a finding as its page lists them."""

from __future__ import annotations

import pytest

from deeptruck_model.mismatch.finding import Size
from deeptruck_model.mismatch.report import wording

DRAGGING = {
    "force": Size(427.9, "N", (265.6, 590.1)),
    "at braking power over 60 s -1.25e-05": Size(0.0, "N"),
    "at braking power over 60 s 2.44": Size(2222.8, "N", (1628.9, 2816.6)),
    "force[b_0]": Size(1295.9, "N", (-22.8, 2614.6)),
    "force[b_1]": Size(0.0, "N"),
}


def shown(parameters: dict[str, Size]) -> dict[str, str]:
    return {row.name: row.text for row in wording.rows(parameters)}


def test_a_place_on_a_curve_has_its_unit_and_next_to_nothing_is_nothing() -> None:
    names = list(shown(DRAGGING))
    assert names[1].endswith(" over 60 s of 0 W/kg")
    assert names[2].endswith(" over 60 s of 2.44 W/kg")


def test_a_recording_keeps_its_name() -> None:
    assert "force in b_0 alone" in shown(DRAGGING)
    assert wording.prose("recording 'b_halfspeed' has brake_command") == (
        "recording 'b_halfspeed' has brake command"
    )
    assert wording.prose("the truck's brake_lag isn't the simulator's") == (
        "the truck's brake lag isn't the simulator's"
    )


def test_a_bare_zero_says_why() -> None:
    rows = shown(DRAGGING)
    assert rows["force in b_1 alone"] == f"0 N: {wording.HELD_AT_ZERO}"
    (curve,) = [text for name, text in rows.items() if name.endswith("of 0 W/kg")]
    assert curve == f"0 N: {wording.ENDS}"


def test_sizes_of_several_kinds_say_how_they_add_up() -> None:
    together = shown(DRAGGING)["together"]
    assert together.startswith(
        "what acts at a moment is the sum of all that hold there: force, the curve over "
    )
    assert together.endswith("force in that recording or near that moment alone")
    assert "together" not in shown({n: p for n, p in DRAGGING.items() if n.startswith("force[")})


@pytest.mark.parametrize(
    ("parameters", "names"),
    [
        (
            {"time_constant": Size(0.595, "s", (0.54, 0.65)), "tau_s": Size(0.6, "s", picked=True)},
            ["time constant"],
        ),
        (
            {"force": Size(400.0, "N", (300.0, 500.0)), "decay_s": Size(20.0, "s", picked=True)},
            ["force", "time in which it fades to a third"],
        ),
    ],
)
def test_a_place_on_a_grid_is_not_told_beside_the_size_fitted_about_it(
    parameters: dict[str, Size], names: list[str]
) -> None:
    assert list(shown(parameters)) == names


def test_what_was_picked_from_a_few_is_told_so() -> None:
    rows = shown({"force": Size(400.0, "N", (300.0, 500.0)), "decay_s": Size(20.0, "s", picked=True)})
    assert rows["time in which it fades to a third"] == "about 20 s, the best of a few that were tried"


def test_a_curve_beside_a_known_form_is_added_to_it_also_where_a_time_was_picked() -> None:
    rows = shown(
        {
            "force_at_150_rad_s": Size(5230.0, "N", (4910.0, 5550.0)),
            "at engine speed 75": Size(820.0, "N", (410.0, 1220.0)),
            "after_s": Size(0.7, "s", picked=True),
        }
    )
    assert rows["force at 150 rad/s"].startswith("5230 N")
    assert rows["together"].endswith("hold there: force at 150 rad/s, the curve over engine speed")


def test_a_size_along_a_stretch_is_told_at_its_ends() -> None:
    size = Size(3000.0, "N", (2950.0, 3050.0))
    sizes = {"force[1501 to 1751 m]": size, "force[drive_2, 72 to 88 s]": size}
    assert list(shown(sizes))[:2] == ["force at 1501 to 1751 m", "force at drive_2, 72 to 88 s"]


def test_a_terminal_tells_settings_and_sizes_but_no_places_of_a_curve() -> None:
    sizes = {
        "at speed 12": Size(0.2, "1", (0.1, 0.3)),
        "force[drive_3, 20 s]": Size(9.0, "N", (1.0, 17.0)),
        "share": Size(0.5, "1", (0.4, 0.6)),
        "tau_s": Size(0.6, "s", picked=True),
    }
    told = {row.name: row.text for row in wording.short_rows(sizes)}
    assert list(told) == ["share", "time constant"] and told["time constant"].startswith("about 0.6 s")


@pytest.mark.parametrize(
    ("low", "told"),
    [
        (1900.0, "2560 kg in b1, 2590 kg in b3; elsewhere none is sure"),
        (-5.0, "in no recording surely other than zero"),
    ],
)
def test_a_terminal_tells_what_each_recording_has_of_its_own(low: float, told: str) -> None:
    sizes = {
        "change[b0]": Size(7.0, "kg", (-700.0, 710.0)),
        "change[b1]": Size(2560.0, "kg", (low, 3200.0)),
        "change[b3]": Size(2590.0, "kg", (low, 3200.0)),
        "change[b3, 20 s]": Size(900.0, "kg", (800.0, 1000.0)),
    }
    assert {row.name: row.text for row in wording.short_rows(sizes)} == {"change": told}
