"""Pictures of capsules, where there is something to draw with; a clear word where there is not."""

import numpy as np
import pytest

from casysid.errors import MissingExtraError
from casysid.simulation.drawing import draw_capsules

START = np.array([[[0.0, 0.0, 0.0], [0.5, 0.0, 0.5]], [[0.0, 0.0, 0.0], [0.5, 0.5, 0.0]]])
END = START + np.array([[0.0, 0.0, 0.4], [0.0, 0.0, 0.0]])
RADIUS = np.array([0.1, 0.05])


def test_without_a_driver_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nothing")
    with pytest.raises(MissingExtraError, match=r"nothing is not available.*Install PyOpenGL"):
        draw_capsules(START, END, RADIUS, [0, 1])


def test_what_moves_is_seen_to_move():
    try:
        pictures = draw_capsules(START, END, RADIUS, [0, 1], boxes=((np.zeros(3), np.ones(3) * 0.1),), size=(64, 48))
    except MissingExtraError as error:
        pytest.skip(str(error))
    assert pictures.shape == (2, 48, 64, 3)
    assert pictures.std() > 5.0
    assert (pictures[0] != pictures[1]).any()
