"""What does not fit into memory is refused before it is asked for."""

import numpy as np
import pytest

from casysid import identifiability, memory
from casysid.accumulation import accumulate_moments
from casysid.dynamics import build_regressor
from casysid.errors import ParameterError
from tests.simulated import bundled_robot


def test_the_limit_is_a_share_of_the_memory_there_is(monkeypatch):
    import resource

    pages = {"SC_PHYS_PAGES": 1000, "SC_PAGE_SIZE": 4096}
    monkeypatch.setattr(memory.os, "sysconf", pages.__getitem__)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY,) * 2)
    assert memory.memory_limit() == pytest.approx(0.8 * 4096e3)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1_000_000, resource.RLIM_INFINITY))
    assert memory.memory_limit() == pytest.approx(0.8e6)


def test_moments_too_large_for_the_machine_are_refused(monkeypatch):
    regressor = build_regressor(bundled_robot("two_link.urdf"))
    samples = np.random.default_rng(0).normal(size=(4, 50, 2))
    wanted = memory.moments_memory([len(own) for own in regressor.row_columns], 5, len(regressor.names))
    monkeypatch.setattr(memory, "memory_limit", lambda: 1.01 * wanted)
    assert accumulate_moments(regressor, *samples, blocks=5).blocks == 5
    monkeypatch.setattr(memory, "memory_limit", lambda: 0.99 * wanted)
    with pytest.raises(ParameterError, match=r"2 joints, \d+ columns and 5 blocks takes about .* GB .* fewer blocks"):
        accumulate_moments(regressor, *samples, blocks=5)


def test_base_parameters_of_too_many_columns_are_refused(monkeypatch):
    monkeypatch.setattr(memory, "memory_limit", lambda: 1000.0)
    with pytest.raises(ParameterError, match=r"base parameters of \d+ columns takes about .* Lock joints"):
        identifiability.structural_base_parameters(build_regressor(bundled_robot("two_link.urdf")))
