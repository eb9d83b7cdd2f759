"""JSON Schema of vehicle files: what they are checked by on loading, and what editors know of them."""

from __future__ import annotations

from deeptruck_core.schema import DRAFT, SWITCH, TEXT, Schema, array, keys, mapping, number, whole
from truck_bridge.j1939 import checksums, diagnostics

VALUE, POSITIVE, RATE = number(-1e6, 1e6), number(1e-6, 1e6), number(1e-3, 1e6)
SECONDS, ADDRESS = number(0.001, 60), whole(0, 253)
CHECK = {"enum": [*checksums.KINDS]}

LIMITS = keys(
    {
        **{name: array(VALUE) for name in ("speed", "low", "high")},
        "rate": RATE,
        "fade": RATE,
        "jerk": number(1e-3, 1e9),
    }
)
TRANSMIT = keys(
    {
        **dict.fromkeys(("message", "to", "demand"), TEXT),
        "period": SECONDS,
        "phase": number(0, 1),
        "check": CHECK,
        "active": mapping(VALUE),
        "release": mapping(VALUE),
        "limits": LIMITS,
    },
    {"idle_at_rest": SWITCH, "start_from": TEXT, "holds_beyond": VALUE},
)
DEMAND = keys({"modes": array({"enum": [1, 2, 3]}), "longest": SECONDS, "period": array(SECONDS)})
RECEIVE = keys(
    {"from": TEXT, "period": SECONDS, "timeout": SECONDS, "signals": mapping(TEXT)},
    {
        "message": TEXT,
        "check": CHECK,
        "range": mapping(array(VALUE)),
        "fastest": mapping(POSITIVE),
        "rises": mapping(POSITIVE),
        "still": mapping(SECONDS),
    },
)
CODE = keys({"spn": whole(1, 0x7FFFE)}, {"fmi": whole(0, 31)})
FAULTS = {
    "lamps": array({"enum": [*diagnostics.LAMPS]}),
    "codes": array(CODE),
    "listen": number(0, 60),
}
TIMING = {  # s; what a controller may be late by is a few of its cycles, and no truck waits a minute for it
    "controller_timeout": number(0.02, 0.5),
    "stall": number(0.02, 0.5),
    "handover": number(0.5, 10),
    "handover_scale": number(0.05, 1),  # 1: rates are never raised
    "stands": number(1, 600),
    "fade_longest": number(0.5, 10),
    "blind": number(1, 60),
    "persist": number(0.05, 2),
    "slowing": number(0.5, 5),
    "settle": number(0.5, 10),
    "weak": number(0.5, 10),
    "answer": number(0.5, 5),
    "unexplained": number(0.1, 5),
    "gear_change": number(0.1, 10),
    "quiet": number(0.1, 60),
    "releases": whole(1, 20),
}
INTERFACE = {
    "engine_unit": {"enum": ["N m", "percent"]},
    "brake_unit": {"enum": ["percent", "m/s^2"]},
    "grade": SWITCH,
    "fuel": SWITCH,
}
DRIVELINE = {
    "rolling_radius": number(0.1, 2),
    "final_drive": number(0.5, 20),
    "tolerance": number(0.01, 1),
}
VEHICLE: Schema = {
    "$schema": DRAFT,
    "title": "vehicle file",
    **keys(
        {
            "name": TEXT,
            "interface": keys(INTERFACE),
            "bridge": keys({"address": ADDRESS, "identity": whole(0, (1 << 21) - 1)}),
            "addresses": mapping(ADDRESS),
            "command": keys({"engine": array(VALUE), "brake": array(VALUE)}),
            "reference_torque": mapping(number(1, 1e5)),
            "transmit": keys({"engine": TRANSMIT, "brake": TRANSMIT}, {"retarder": TRANSMIT}),
            "demands": mapping(mapping(DEMAND)),
            "receive": mapping(RECEIVE),
            "driver": mapping(VALUE),
            "forbidden": mapping(VALUE),
            "engage": keys({"speed": array(VALUE), "needs_lead": SWITCH}),
        },
        {
            "truck": TEXT,
            "dbc": array(TEXT),
            "driveline": keys(DRIVELINE),
            "obeys": mapping(array(VALUE)),
            "follows": mapping(keys({"signal": TEXT, "beyond": VALUE})),
            "coasts": number(0.3, 5),
            "set_speed": number(1, 50),
            "faults": keys({}, FAULTS),
            "timing": keys({}, TIMING),
        },
    ),
}
