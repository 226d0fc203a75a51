"""Two routes through many samples: both give what the function gives, one sample at a time."""

import os
import shutil
import threading
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from casysid.dynamics import Bulk, bulk, compiled, kernel_cache
from casysid.dynamics.instructions import OPERATIONS
from casysid.errors import CasysidWarning, ParameterError

needs_compiler = pytest.mark.skipif(
    shutil.which("gcc") is None and shutil.which("cc") is None, reason="needs a compiler"
)
X, Y = ca.SX.sym("x"), ca.SX.sym("y", 2)
ARITHMETIC = ca.Function(
    "f", [X, Y], [ca.vertcat(ca.sin(X) * Y[0] - 3, ca.exp(Y[1]) / (1 + X**2), Y[0], -2.5)], ["x", "y"], ["z"]
)


def samples(count, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 1)), rng.normal(size=(count, 2))


def one_by_one(function, *inputs):
    return np.array([function(*state).nonzeros() for state in zip(*inputs, strict=True)])


@pytest.fixture
def compile_at_once(monkeypatch):
    monkeypatch.setattr(bulk, "FIND_FROM", 0)
    monkeypatch.setattr(bulk, "COMPILE_FROM", 0)


def every_operation():
    """All operations that SX has, on operands where they are defined."""
    s, p = 0.5 + 0.4 * ca.tanh(X), Y  # s in (0.1, 0.9)
    c = p[0] < p[1]
    return ca.vertcat(
        -X, X + s, X - s, X * s, X / s, 1 / s, X * X, 2 * X, s ** p[0], s**2.5, ca.sqrt(s), ca.exp(X), ca.expm1(X),
        ca.log(s), ca.log1p(s), ca.sin(X), ca.cos(X), ca.tan(s), ca.asin(s), ca.acos(s), ca.atan(X), ca.atan2(X, s),
        ca.sinh(X), ca.cosh(X), ca.tanh(X), ca.asinh(X), ca.acosh(1 + s), ca.atanh(s), ca.erf(X), ca.hypot(X, s),
        ca.fabs(X), ca.sign(X), ca.copysign(s, X), ca.fmin(X, s), ca.fmax(X, s), ca.fmod(X, s), ca.floor(X), ca.ceil(X),
        c, p[0] <= p[1], p[0] == p[1], p[0] != p[1], ca.logic_and(c, X), ca.logic_or(c, X > 0), ca.logic_not(c),
        ca.if_else(c, X, s), ca.if_else(c, 3.0, 0.0), ca.SX(7),
    )  # fmt: skip


OPERATING = ca.Function("f", [X, Y], [every_operation()])


def test_the_function_of_all_operations_has_all_operations():
    used = {OPERATING.instruction_id(k) for k in range(OPERATING.n_instructions())}
    assert set(OPERATIONS) - used <= {ca.OP_ASSIGN}


def test_the_replay_is_the_function():
    evaluator = Bulk(OPERATING)
    np.testing.assert_allclose(evaluator.evaluate(*samples(50)), one_by_one(OPERATING, *samples(50)), rtol=1e-13)
    assert evaluator.route == "replay"


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
def test_the_compiled_kernel_is_the_function():
    evaluator = Bulk(OPERATING)
    np.testing.assert_allclose(evaluator.evaluate(*samples(50)), one_by_one(OPERATING, *samples(50)), rtol=1e-13)
    assert evaluator.route == "compiled"


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("count", [1, 4095, 4097, 9000])
def test_chunks_and_threads_change_nothing(count, threads):
    inputs = samples(count)
    x, y = inputs[0][:, 0], inputs[1].T
    wanted = np.column_stack([np.sin(x) * y[0] - 3, np.exp(y[1]) / (1 + x**2), y[0], np.full(count, -2.5)])
    np.testing.assert_allclose(Bulk(ARITHMETIC).evaluate(*inputs, threads=threads), wanted, rtol=1e-14)


def test_an_input_may_be_the_same_for_all_samples():
    x, y = samples(10)
    wanted = Bulk(ARITHMETIC).evaluate(x, np.tile(y[3], (10, 1)))
    np.testing.assert_array_equal(Bulk(ARITHMETIC).evaluate(x, y[3]), wanted)
    np.testing.assert_array_equal(Bulk(ARITHMETIC).evaluate(x[0], y[3]), wanted[:1])


def test_an_input_may_be_settled_beforehand():
    x, y = samples(10)
    evaluator = Bulk(ARITHMETIC)
    for k in range(3):
        np.testing.assert_array_equal(evaluator.given(y[k]).evaluate(x), evaluator.evaluate(x, y[k]))
    with pytest.raises(ParameterError, match=r"wants x \(N, 1\)"):
        evaluator.given(y[0]).evaluate(x, y)


def test_no_samples_give_no_values():
    assert Bulk(ARITHMETIC).evaluate(*samples(0)).shape == (0, 4)


@needs_compiler
def test_only_many_samples_are_compiled(cache, monkeypatch):
    monkeypatch.setattr(bulk, "COMPILE_FROM", 1000)
    monkeypatch.setattr(bulk, "FIND_FROM", 500)
    evaluator = Bulk(ARITHMETIC)
    evaluator.evaluate(*samples(800))
    assert evaluator.route == "replay"
    assert not cache.exists()
    before = evaluator.evaluate(*samples(300))
    assert evaluator.route == "compiled"
    assert [path.suffix for path in cache.iterdir()] == [".so"]
    np.testing.assert_allclose(before, one_by_one(ARITHMETIC, *samples(300)), rtol=1e-14)
    another = Bulk(ARITHMETIC)
    another.evaluate(*samples(500))  # too few to compile, enough to look
    assert another.route == "compiled"


@pytest.mark.usefixtures("compile_at_once")
def test_without_a_compiler_the_replay_serves(monkeypatch):
    monkeypatch.setenv("PATH", "")
    evaluator = Bulk(ARITHMETIC)
    np.testing.assert_allclose(evaluator.evaluate(*samples(5)), one_by_one(ARITHMETIC, *samples(5)), rtol=1e-14)
    assert evaluator.route == "replay"


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
def test_any_failure_to_compile_leaves_the_replay(monkeypatch):
    monkeypatch.setattr(compiled, "_FLAGS", ("-fno-such-flag",))
    evaluator = Bulk(ARITHMETIC)
    np.testing.assert_allclose(evaluator.evaluate(*samples(5)), one_by_one(ARITHMETIC, *samples(5)), rtol=1e-14)
    assert evaluator.route == "replay"


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
def test_a_kernel_that_cannot_be_kept_is_used_all_the_same(cache):
    cache.parent.write_text("a file where a directory should be")
    evaluator = Bulk(ARITHMETIC)
    np.testing.assert_allclose(evaluator.evaluate(*samples(5)), one_by_one(ARITHMETIC, *samples(5)), rtol=1e-14)
    assert evaluator.route == "compiled"


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
@pytest.mark.parametrize("fault", ["ended early", "changed", "not a library", "of another source"])
def test_a_damaged_library_in_the_cache_is_compiled_again_with_a_word(cache, fault):
    function, other = ca.Function("f", [X], [ca.cos(X) + 17]), ca.Function("f", [X], [ca.cos(X) + 18])
    compiled.compile_kernel(other)
    (foreign,) = cache.iterdir()
    compiled.compile_kernel(function)
    (library,) = set(cache.iterdir()) - {foreign}
    content = library.read_bytes()
    library.write_bytes(
        {
            "ended early": content[:8192],
            "changed": content[:4096] + bytes(1024) + content[5120:],
            "not a library": b"not a library",
            "of another source": foreign.read_bytes(),
        }[fault]
    )
    evaluator = Bulk(function)
    with pytest.warns(CasysidWarning, match=f"{library} is damaged; it was removed"):
        np.testing.assert_array_equal(evaluator.evaluate(np.zeros((5, 1))), np.full((5, 1), 18.0))
    assert evaluator.route == "compiled"
    assert library.read_bytes() == content


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
@pytest.mark.parametrize("fault", ["writable file", "link", "pipe", "file of another"])
def test_a_library_that_somebody_else_may_have_written_is_not_loaded(cache, fault, tmp_path):
    function = ca.Function("f", [X], [ca.cos(X) + 17])
    compiled.compile_kernel(function)
    (library,) = cache.iterdir()
    match fault:
        case "writable file":
            library.chmod(0o666)
        case "link":
            library.rename(tmp_path / "elsewhere.so")
            library.symlink_to(tmp_path / "elsewhere.so")
        case "pipe":
            library.unlink()
            os.mkfifo(library)
        case _:
            change_owner(library)
    with pytest.warns(CasysidWarning, match=f"{library} .*; it was removed"):
        assert compiled.find_kernel(function) is None
    assert not os.path.lexists(library)


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
@pytest.mark.parametrize("fault", ["writable", "of another"])
def test_a_cache_that_others_can_write_to_is_neither_read_nor_written(cache, fault):
    function = ca.Function("f", [X], [ca.cos(X) + 17])
    compiled.compile_kernel(function)
    cache.chmod(0o777) if fault == "writable" else change_owner(cache)
    before = {path: path.read_bytes() for path in cache.iterdir()}
    with pytest.warns(CasysidWarning, match=f"the folder {cache} .* nothing is loaded from it nor kept there"):
        assert compiled.find_kernel(function) is None
    with pytest.warns(CasysidWarning, match="nothing is loaded"):
        assert compiled.compile_kernel(function) is not None
    assert {path: path.read_bytes() for path in cache.iterdir()} == before


@needs_compiler
def test_a_relative_cache_directory_is_ignored_with_a_word(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", "c")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    with pytest.warns(CasysidWarning, match="XDG_CACHE_HOME is 'c'; wanted an absolute path"):
        assert compiled.compile_kernel(ARITHMETIC) is not None
    assert not (tmp_path / "c").exists()
    assert list((tmp_path / "home/.cache/casysid/kernels").iterdir())


def change_owner(path):
    if os.geteuid() != 0:
        pytest.skip("needs root")
    os.chown(path, 12345, -1)


@needs_compiler
@pytest.mark.parametrize("seed", range(3))
def test_both_routes_give_the_same_bits(cache, seed, monkeypatch):
    inputs = samples(5000, seed)
    replayed = Bulk(OPERATING).evaluate(*inputs)
    monkeypatch.setattr(bulk, "FIND_FROM", 0)
    monkeypatch.setattr(bulk, "COMPILE_FROM", 0)
    built = Bulk(OPERATING)
    assert built.evaluate(*inputs).tobytes() == replayed.tobytes()
    monkeypatch.setattr(bulk, "COMPILE_FROM", np.inf)
    found = Bulk(OPERATING)
    assert found.evaluate(*inputs).tobytes() == replayed.tobytes()
    assert (built.route, found.route) == ("compiled", "compiled")


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
def test_a_kernel_that_computes_something_else_is_not_used(monkeypatch):
    monkeypatch.setattr(compiled, "_PROLOGUE", compiled._PROLOGUE + "#define sin cos\n")
    evaluator = Bulk(ARITHMETIC)
    np.testing.assert_allclose(evaluator.evaluate(*samples(5)), one_by_one(ARITHMETIC, *samples(5)), rtol=1e-14)
    assert evaluator.route == "replay"


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
def test_many_may_compile_the_same_at_once(cache):
    start = threading.Barrier(4)

    def work(_):
        evaluator = Bulk(ARITHMETIC)
        start.wait()
        evaluator.evaluate(*samples(5))
        return evaluator.route

    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(work, range(4))) == {"compiled"}
    assert len(os.listdir(cache)) == 1


@needs_compiler
@pytest.mark.usefixtures("compile_at_once")
def test_the_cache_keeps_the_newest_kernels_only(cache, monkeypatch):
    monkeypatch.setattr(kernel_cache, "KEPT", 2)
    for k in range(4):
        Bulk(ca.Function("f", [X], [k + X])).evaluate(np.zeros((5, 1)))
    assert len(os.listdir(cache)) == 2


def test_what_cannot_be_replayed_is_refused():
    matrix = ca.MX.sym("m", 2)
    with pytest.raises(ParameterError, match="needs an SX function with one output"):
        Bulk(ca.Function("f", [matrix], [2 * matrix])).evaluate(np.zeros((3, 2)))


@pytest.mark.parametrize(
    "inputs", [(np.zeros((3, 1)),), (np.zeros((3, 1)), np.zeros((4, 2))), (np.zeros((3, 2)), np.zeros((3, 2)))]
)
def test_inputs_that_do_not_fit_are_refused(inputs):
    with pytest.raises(ParameterError, match=r"f: wants x \(N, 1\), y \(N, 2\); got"):
        Bulk(ARITHMETIC).evaluate(*inputs)


def test_an_error_while_consuming_is_raised():
    evaluator = Bulk(ARITHMETIC)
    arrays, count = evaluator.check(samples(20_000))

    def fail(values, piece):
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        list(evaluator.map(fail, arrays, [np.arange(count)], threads=2))
