"""Random experiments with known truth: how they are drawn, identified, judged and put in a table.

Every experiment is a seed. Its parts (mechanism, motion, friction, sensors, faults, model file) are drawn one after the
other from streams of their own, so that a change in one part leaves the others of the same seed as they were.
"""
