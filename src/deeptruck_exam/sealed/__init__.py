"""The twenty-second family of hidden effects, read by nobody who works on the tool until it has been proved.

Contract: one module for each part of the truck, every law declared as in `deeptruck_exam.effects.planting`
with the family "sealed". All 26 names of `deeptruck_exam.effects` and the four faults of measurement have a
law, and eight have no name ("unknown"). Sources, state variables and couplings differ from those of the
development set. Forces are smooth enough for a step of 10 ms, 0 at rest, finite, and below 0.6 m/s2 rms.
No module imports another family's laws, nor the tool. A sealed family is proved once; then it joins the
development set. Its cases play in a world that comes with it, `SEALED_WORLD` of `deeptruck_exam.worlds`.
"""
