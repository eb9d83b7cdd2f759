"""JSON Schema of vehicle files: what they are checked by on loading, and what editors know of them."""

from __future__ import annotations

from deeptruck_core.schema import DRAFT, SWITCH, TEXT, Schema, array, keys, mapping, means, number, whole
from truck_bridge.j1939 import checksums, diagnostics
from truck_bridge.safety import Timing

VALUE, POSITIVE, RATE = number(-1e6, 1e6), number(1e-6, 1e6), number(1e-3, 1e6)
SECONDS, ADDRESS = number(0.001, 60), whole(0, 253)
CHECK = {"enum": [*checksums.KINDS]}

LIMITS = keys(
    {
        "speed": means("points of the envelope, m/s; linear between them, constant outside", array(VALUE)),
        "low": means("least demand at these points", array(VALUE)),
        "high": means("greatest demand at these points", array(VALUE)),
        "rate": means("greatest change while engaged, unit/s", RATE),
        "fade": means("change towards rest after a loss, unit/s", RATE),
        "jerk": means("greatest change of the rate, unit/s^2", number(1e-3, 1e9)),
    }
)
TRANSMIT = keys(
    {
        "message": means("message that carries the demand", TEXT),
        "to": means("controller that is commanded", TEXT),
        "demand": means("signal of the demand", TEXT),
        "period": means("s between frames", SECONDS),
        "phase": means("of the period, so that frames of axes do not coincide", number(0, 1)),
        "check": means("counter and checksum in byte 8: none, as of TSC1 or as of XBR", CHECK),
        "active": means("signals of a commanding frame", mapping(VALUE)),
        "release": means("signals of the frames that hand back", mapping(VALUE)),
        "limits": means("envelope of the demand", LIMITS),
    },
    {
        "idle_at_rest": means("a demand at rest is sent as a release", SWITCH),
        "start_from": means("received signal where the demand starts on engagement", TEXT),
        "holds_beyond": means(
            "demand that gives 1.5 m/s^2 on the level; beyond it only a hazard is braked for", VALUE
        ),
    },
)
ENGINE = means("brake and retarder, which is optional, have the same keys", TRANSMIT)
DEMAND = keys(
    {
        "modes": means(
            "1 speed, 2 torque, 3 limit of both (SPN 695); 0 releases, always", array({"enum": [1, 2, 3]})
        ),
        "longest": means("one demand, s", SECONDS),
        "period": means("least and greatest time between messages, s", array(SECONDS)),
    }
)
RECEIVE = keys(
    {
        "from": means("controller that sends it", TEXT),
        "period": means("nominal, s; more than 1.75 times as often is another sender", SECONDS),
        "timeout": means("s without it until it counts as lost", SECONDS),
        "signals": means("our name of each signal, and the message's", mapping(TEXT)),
    },
    {
        "message": means("its name, where two controllers send it", TEXT),
        "check": means("as of transmit; a wrong checksum or counter is refused, one gap forgiven", CHECK),
        "range": means("of a signal; beyond it the value is invalid", mapping(array(VALUE))),
        "fastest": means(
            "greatest change of a signal, unit/s; a jump beyond it is not taken", mapping(POSITIVE)
        ),
        "rises": means("greatest rise, unit/s, where that is less", mapping(POSITIVE)),
        "still": means(
            "longest that a sound sensor repeats one value, s; then it is frozen", mapping(SECONDS)
        ),
    },
)
CODE = keys({"spn": whole(1, 0x7FFFE)}, {"fmi": whole(0, 31)})
FAULTS = {
    "lamps": means("lamps that forbid control", array({"enum": [*diagnostics.LAMPS]})),
    "codes": means("codes that do: SPN and, if only that counts, FMI; 1569 holds torque back", array(CODE)),
    "listen": means(
        "s of reception until no report means no fault; DM1 comes once a second: 2", number(0, 60)
    ),
}
TIMING = {  # no truck needs more than five times the core's own, or less than a fifth
    **{name: number(default / 5, 5 * default) for name, default in vars(Timing()).items()},
    "assumed": number(10, 30),  # to a standstill from 30 m/s, by 3 to 1 m/s^2
    "fade_longest": number(0.8, 10),  # a driver who is asked takes over within 10 s (UN R157, 5.4)
    "handover_scale": number(0.1, 1),  # 1: rates are never raised
    "releases": whole(1, 20),
}
INTERFACE = {
    "engine_unit": means("of the controller's engine command", {"enum": ["N m", "percent"]}),
    "brake_unit": means("of its brake command", {"enum": ["percent", "m/s^2"]}),
    "grade": means("the controller gets the slope", SWITCH),
    "fuel": means("fuel rate is recorded", SWITCH),
}
DRIVELINE = {
    "rolling_radius": means("of the driven wheels, m; wear takes up to 3 %", number(0.1, 2)),
    "final_drive": means("ratio of the axle", number(0.5, 20)),
    "tolerance": means("relative, plus 0.5 m/s; truck-bridge check shows the truck's own", number(0.01, 1)),
}
BRIDGE = {
    "address": means("our own on the bus", ADDRESS),
    "identity": means("of our J1939 NAME", whole(0, (1 << 21) - 1)),
}
COMMAND = {
    "engine": means("least and greatest sane command; others are refused", array(VALUE)),
    "brake": means("likewise", array(VALUE)),
}
ENGAGE = {
    "speed": means("least and greatest speed at which control may begin, m/s", array(VALUE)),
    "needs_lead": means("only behind a vehicle", SWITCH),
}
FOLLOWED = {
    "signal": means("received, in the unit of the axis", TEXT),
    "beyond": means("difference from our demand from which somebody else demands, signed", VALUE),
}
VEHICLE: Schema = {
    "$schema": DRAFT,
    "title": "vehicle file",
    **keys(
        {
            "name": means("of the truck", TEXT),
            "interface": means("the controller's units and inputs", keys(INTERFACE)),
            "bridge": means("who we are on the bus", keys(BRIDGE)),
            "addresses": means("of the truck's controllers", mapping(ADDRESS)),
            "command": means("what a controller may command, in its units", keys(COMMAND)),
            "reference_torque": means(
                "N m that 100 % mean, by controller (SPN 544, 556)", mapping(number(1, 1e5))
            ),
            "transmit": means(
                "what is commanded, axis by axis",
                keys({"engine": ENGINE, "brake": TRANSMIT}, {"retarder": TRANSMIT}),
            ),
            "demands": means(
                "by controller and axis, what others may demand by TSC1", mapping(mapping(DEMAND))
            ),
            "receive": means("by message, what must be received", mapping(RECEIVE)),
            "driver": means("signals at or above which the driver takes over", mapping(VALUE)),
            "forbidden": means("signals at a value that forbids control", mapping(VALUE)),
            "engage": means("when a person may engage", keys(ENGAGE)),
        },
        {
            "truck": means("physics truck of the emulator", TEXT),
            "dbc": means("files of the truck's own messages", array(TEXT)),
            "driveline": means("wheel speed against engine speed and gear", keys(DRIVELINE)),
            "obeys": means(
                "values of signals by which a controller obeys itself or us", mapping(array(VALUE))
            ),
            "follows": means("by axis, what its actuator does", mapping(keys(FOLLOWED))),
            "coasts": means(
                "greatest deceleration without a demand of ours, m/s^2; 1.5 where absent", number(0.3, 5)
            ),
            "set_speed": means("m/s beyond which no leader is followed; 25 where absent", number(1, 50)),
            "faults": means(
                "active faults (DM1) that forbid control; the red stop lamp where absent", keys({}, FAULTS)
            ),
            "timing": means("times of the core, s", keys({}, TIMING)),
        },
    ),
}
