"""Inside a door every library of linear algebra has one thread; afterwards it has what it had."""

import inspect
import json
import os
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from importlib import import_module

import casadi as ca
import numpy as np
import pytest
import scipy.linalg  # noqa: F401  (its BLAS is one of those that are looked at)
from hypothesis import given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_info, threadpool_limits

import casysid
from casysid.excitation import build_excitation, design_excitation
from casysid.identification import Settings, compare, identify, prepare
from casysid.nlp import build_nlp, solve_nlp
from casysid.simulation import PlantSettings
from casysid.threads import single_threaded
from casysid.validation import RehearsalSettings, rehearse, validate
from tests.simulated import bundled_robot, simulated_run

SEVERAL = 3
ROOMS = ("identification", "validation", "simulation", "excitation", "projection", "report")
NO_DOORS = {
    "build_dynamics": "symbols only",
    "build_regressor": "symbols only",
    "capsules_of": "no matrices larger than four by four",
    "check_collisions": "distances between shapes only",
    "choose_series": "scalars only",
    "choice_table": "words only",
    "choose_band": "spectra, which have one thread",
    "drive_table": "words only",
    "error_table": "words only",
    "find_model": "a path",
    "find_way": "distances and vectors only",
    "further_drive_table": "words only",
    "generate_c": "symbols only",
    "keep_in": "symbols only",
    "limits_of": "vectors only",
    "link_mass": "what is known, in words",
    "link_table": "words only",
    "center_of_mass_within": "what is known, in words",
    "nearest_in_half_spaces": "inside doors only, and small",
    "noise_table": "words only",
    "open_recording": "scan_recording is its door",
    "open_recordings": "scan_recording is its door",
    "parameter_within": "what is known, in words",
    "read_earlier_result": "a file",
    "read_experiment": "a file",
    "read_recording": "load_recording is its door",
    "read_recordings": "load_recording is its door",
    "read_result": "files",
    "total_mass": "what is known, in words",
    "write_excitation": "design.check and describe are its doors",
    "write_rehearsal": "a file",
    "write_result": "a file",
    "write_robot": "no matrices larger than four by four",
}


def pools(user_api=None):
    return {pool["filepath"]: pool["num_threads"] for pool in threadpool_info() if user_api in (None, pool["user_api"])}


@pytest.fixture
def several():
    """Every library has several threads, as on a machine whose owner set nothing."""
    with threadpool_limits(SEVERAL):
        assert {SEVERAL} == set(pools("blas").values())
        yield


@pytest.fixture
def seen(several):
    """A progress function that notes how many threads there are, and what it noted."""
    found = set()

    def note(*_):
        found.update(pools().values())
        return False

    return note, found


def test_one_thread_inside_and_afterwards_what_it_was(several):
    before = pools()
    with single_threaded():
        assert set(pools().values()) == {1}
        with single_threaded():
            assert set(pools().values()) == {1}
        assert set(pools().values()) == {1}
    assert pools() == before


def test_an_exception_gives_the_threads_back(several):
    @single_threaded()
    def fail():
        raise KeyError(max(pools().values()))

    before = pools()
    with pytest.raises(KeyError, match="1"):
        fail()
    assert pools() == before


def test_different_numbers_come_back(several):
    with threadpool_limits(2, user_api="openmp"):
        before = pools()
        with single_threaded():
            assert set(pools().values()) == {1}
        assert pools() == before


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(0, 2), st.booleans()), max_size=12))
def test_the_last_python_thread_that_leaves_gives_back(steps):
    """Three Python threads enter and leave in any order, inside each other as well."""
    with ExitStack() as ends, threadpool_limits(SEVERAL):
        workers = [ends.enter_context(ThreadPoolExecutor(1)) for _ in range(3)]
        own = [worker.submit(pools, "openmp").result() for worker in workers]
        inside = [[], [], []]
        for who, enters in [*steps, *((k, False) for k in range(3) for _ in steps)]:
            if enters:
                context = single_threaded()
                workers[who].submit(context.__enter__).result()
                inside[who].append(context)
            elif inside[who]:
                workers[who].submit(inside[who].pop().__exit__, None, None, None).result()
            assert set(pools("blas").values()) == {1 if any(inside) else SEVERAL}
            of_worker = workers[who].submit(pools, "openmp").result()
            assert of_worker == (dict.fromkeys(own[who], 1) if inside[who] else own[who])


def test_a_limit_of_the_callers_own_survives_a_door_in_another_thread(several):
    with ThreadPoolExecutor(1) as other, threadpool_limits(2, user_api="blas"):
        other.submit(single_threaded()(lambda: None)).result()
        assert set(pools("blas").values()) == {2}
    assert set(pools("blas").values()) == {SEVERAL}


@pytest.mark.parametrize("held", [False, True])
def test_libraries_that_come_later_are_held_and_given_back(held):
    code = f"""
        import sys
        from contextlib import nullcontext
        from threadpoolctl import threadpool_info
        from casysid.threads import single_threaded
        import numpy
        assert "scipy" not in sys.modules
        door = {"single_threaded" if held else "nullcontext"}
        with door():
            import scipy.linalg, sklearn.linear_model
            with door():
                inside = [pool["num_threads"] for pool in threadpool_info()]
        import os
        # OpenBLAS has no more threads than there are processors
        most = {{"blas": min({SEVERAL}, len(os.sched_getaffinity(0))), "openmp": {SEVERAL}}}
        usual = [most[pool["user_api"]] for pool in threadpool_info()]
        assert len(usual) > 2
        assert inside == ([1] * len(usual) if {held} else usual), inside
        assert [pool["num_threads"] for pool in threadpool_info()] == usual
    """
    environment = {**os.environ, "OMP_NUM_THREADS": str(SEVERAL)}
    subprocess.run([sys.executable, "-c", textwrap.dedent(code)], env=environment, check=True)


def test_the_blas_that_comes_with_casadi_is_held(several):
    x, held = ca.SX.sym("x", 3), []

    def note(_):
        held.extend(pool["num_threads"] for pool in threadpool_info() if "casadi" in pool["prefix"])
        return False

    solve_nlp(build_nlp(x, ca.sumsqr(x - 1.0) ** 2), np.zeros(3), progress=note)
    assert set(held) == {1}


def test_identification_has_one_thread(seen):
    note, found = seen
    robot, log = bundled_robot("two_link.urdf"), simulated_run("two_link.urdf", 0, PlantSettings(), 4.0).recording
    wanted, before = Settings(cutoff=12.0, choose_friction=False), pools("blas")
    identify(robot, log, wanted, progress=note)
    compare(prepare(robot, log, wanted, progress=note), [wanted.method], wanted, progress=note)
    validate(robot, [log], progress=note)
    assert found == {1}
    assert before.items() <= pools("blas").items()


def test_experiments_have_one_thread(seen):
    note, found = seen
    robot, before = bundled_robot("two_link.urdf"), pools("blas")
    design_excitation(build_excitation(robot), starts=1, max_iterations=3, progress=note)
    wanted = RehearsalSettings(duration=4.0, identification=Settings(cutoff=12.0, choose_friction=False))
    rehearse(robot, wanted, note)
    assert found == {1}
    assert before.items() <= pools("blas").items()


@pytest.mark.parametrize("room", ["", *ROOMS])
def test_every_public_function_is_a_door_or_has_a_reason_not_to_be(room):
    module = import_module(f"casysid.{room}") if room else casysid
    functions = [name for name in module.__all__ if inspect.isfunction(getattr(module, name))]
    closed = {name for name in functions if not _is_door(getattr(module, name))}
    assert closed <= NO_DOORS.keys()


def _is_door(function):
    return inspect.unwrap(function) is not function


@pytest.mark.slow
def test_numbers_do_not_depend_on_the_number_of_threads(tmp_path):
    log = simulated_run("scara.urdf", 0, PlantSettings(), 4.0).recording.write(tmp_path / "log.parquet")
    results = []
    for threads in ("1", "2"):
        out = tmp_path / threads
        command = f"identify scara {log} --split 0.6 --cutoff 12 --friction plain --out {out}".split()
        cache = tmp_path / f"cache of {threads}"  # what one has compiled is not there for the other
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "XDG_CACHE_HOME": str(cache)}
        subprocess.run([sys.executable, "-m", "casysid", *command], env=environment, check=True, capture_output=True)
        content = json.loads((out / "result.json").read_text())
        del content["seconds"]
        results.append(content)
    assert results[0] == results[1]
