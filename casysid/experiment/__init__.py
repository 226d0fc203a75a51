"""A whole identification as one file: what goes in, how it is treated, what comes out; and the same numbers again."""

from casysid.experiment.description import Experiment, RecordingEntry, read_experiment
from casysid.experiment.running import Outcome, run_experiment

__all__ = ["Experiment", "Outcome", "RecordingEntry", "read_experiment", "run_experiment"]
