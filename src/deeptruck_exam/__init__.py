"""The proof: hidden effects, sealed cases and their scoring. Imports nothing of the tool it examines.

Seven families of laws hide under the same names (`hidden.FORMS`). The first (effects_*.py) is the textbook
form of each effect, open to the tool's authors, and the default of the development commands. The second
(alternatives/) has other laws in the same world. The third (other_makers/) has other laws again and a world
of its own, world.py: trucks, roads, drivers, sensors; it has become one for development too. The fourth
(field_reports/) has laws after field reports, service practice and standards, unlike all three, and once more
a world of its own; it too has served development since. The fifth (fleet_trials/) has laws as instrumented
trucks of fleets show them, with other state variables and couplings, and a world of its own again; it has
served since. The sixth (breakdown_records/) has laws after breakdowns, recalls and roadside service, other
again, and a world of its own; it serves development now. The seventh (proving_ground/) has laws after
certification laboratories, proving grounds and suppliers' benches, and a world of its own once more; it is
the default of `prove`, and whoever works on the tool leaves it unread.
makers.py says which world a family plays in; a deep simulator's cases play in the first world with any
family.
"""
