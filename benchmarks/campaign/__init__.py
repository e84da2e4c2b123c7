"""The hidden-effect campaign: sealed scenarios, the finder at work on them, and how often it was right.

The truth is the stand-in's mechanics; the finder is given recordings and a URDF. The line of a scenario:
draw (`scenario`) → play (`playing`, or over the wire, `wire`) → seal (`sealing`) → find (`finding`) → open and
judge (`judging`) → tally over all scenarios (`tally`).
"""
