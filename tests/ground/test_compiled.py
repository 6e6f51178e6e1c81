"""Kernels: compiled and plain forms agree, and the cache follows the sources."""

import copy
import dis
import hashlib
import inspect
import os
import pkgutil
import subprocess
import sys
import types
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

import shipnet
from shipnet import Code, asi, can
from shipnet.compiled import KERNELS, MANY, Kernel, _Cache, compiled
from shipnet.errors import ArgumentError
from tests.kernels import ARGUMENTS

for found in pkgutil.walk_packages(shipnet.__path__, "shipnet."):
    if "@compiled" in Path(found.module_finder.find_spec(found.name).origin).read_text("utf-8"):
        import_module(found.name)

NAMES = sorted(name for name in KERNELS if name.startswith("shipnet."))


def test_every_kernel_has_arguments():
    assert sorted(ARGUMENTS) == NAMES


def same(one, other):
    """Integers and booleans are equal, floats agree to 1e-12, whatever holds them."""
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    one, other = np.asarray(one), np.asarray(other)
    if one.shape != other.shape:
        return False
    if one.dtype.names:
        return all(same(one[name], other[name]) for name in one.dtype.names)
    if one.dtype.kind in "fc" or other.dtype.kind in "fc":
        scale = np.abs(one[np.isfinite(one)]).max(initial=0)
        return np.allclose(one, other, rtol=1e-12, atol=1e-12 * scale, equal_nan=True)
    return np.array_equal(one, other)


@pytest.mark.parametrize("name", NAMES)
def test_compiled_and_plain_forms_agree(name):
    kernel = KERNELS[name]

    @settings(max_examples=40)
    @given(ARGUMENTS[name])
    def compare(arguments):
        # A kernel may write into its arguments, and draws from a generator change it.
        first, second = copy.deepcopy(arguments), copy.deepcopy(arguments)
        assert same(kernel(*first), kernel.fast(*second))
        for one, other in zip(first, second, strict=True):
            if isinstance(one, np.ndarray):
                assert same(one, other)
            elif isinstance(one, np.random.Generator):
                assert one.bit_generator.state == other.bit_generator.state

    compare()


@pytest.mark.parametrize("name", NAMES)
def test_a_kernel_reads_only_modules_and_kernels(name):
    plain = KERNELS[name].plain
    read = [step.argval for step in dis.get_instructions(plain) if step.opname == "LOAD_GLOBAL"]
    scope = plain.__globals__
    others = [
        global_name
        for global_name in read
        if global_name in scope and not isinstance(scope[global_name], Kernel | types.ModuleType)
    ]
    assert others == []
    assert not plain.__defaults__ and not plain.__kwdefaults__ and not plain.__closure__


@compiled
def step(value):
    """Return the next value."""
    return value + 1


@compiled
def climb(steps):
    """Return the value after some steps."""
    value = 0
    for _ in range(steps):
        value = step(value)
    return value


@pytest.mark.parametrize("steps", [MANY - 1, MANY])
def test_the_number_of_steps_alone_decides_which_form_runs(steps, monkeypatch):
    monkeypatch.setitem(climb.__dict__, "fast", lambda value: f"compiled {value}")
    assert climb.run(steps, 7) == ("compiled 7" if steps >= MANY else 7)
    monkeypatch.setenv("SHIPNET_COMPILED", "0")
    assert climb.run(steps, 7) == 7


def test_without_numba_a_warning_comes_only_where_the_work_is_large(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    climb.__dict__.pop("fast", None)
    assert climb.run(MANY, 7) == 7
    with pytest.warns(RuntimeWarning, match=r"numba is not installed, so climb runs as Python"):
        assert climb.run(10**9, 7) == 7


SMALL = {
    "the check of a ring of 10 slaves": lambda: asi.ring(100, 10).check(),
    "one telegram": lambda: asi.line(100, (5,)).waveform("0011001", "5 m").receive(),
    "a record of 5 ms": lambda: asi.decode(asi.line(80, (1, 40)).record(5e-3, rng=2024)),
    "20 cycles of 31 slaves": lambda: asi.simulate(SLAVES, cycles=20).table(),
    "ten CAN messages for 1 s": lambda: can.simulate(MESSAGES, 250e3, until=1.0).table(),
}
SLAVES = [asi.Slave(f"{address}") for address in range(1, 32)]
MESSAGES = can.MessageSet(can.Message(f"m{k}", k, 8, 0.02) for k in range(10))


@pytest.mark.parametrize("job", SMALL)
def test_small_jobs_never_wait_for_the_compiler(job, monkeypatch):
    def wait(kernel):
        pytest.fail(f"{kernel.plain.__name__} is compiled")

    monkeypatch.setattr(Kernel, "fast", property(wait))
    SMALL[job]()


PROGRAM = """
import sys
import numpy as np
sys.prefix = sys.base_prefix
from model import climb
steps = np.dtype(sys.argv[1]).type(sys.argv[2])
print(climb.run(steps, steps), "numba" in sys.modules)
"""


def start(folder, kind="int64"):
    """Start the program in a folder that also contains its cache."""
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", PROGRAM, kind, str(MANY)],
        env=os.environ | {"HOME": str(folder), "USERPROFILE": str(folder)},
        cwd=folder,
        stdout=subprocess.PIPE,
        text=True,
    )


def printed(process):
    return process.communicate()[0].split()


def test_processes_share_a_cache_and_an_edited_source_is_compiled_again(tmp_path):
    models = inspect.getsource(step.plain) + inspect.getsource(climb.plain)
    model, imported = tmp_path / "model.py", "from shipnet.compiled import compiled\n"
    model.write_text(imported + models, "utf-8")
    for _ in range(2):
        both = [start(tmp_path, kind) for kind in ("int32", "int64")]
        assert [printed(process) for process in both] == [[str(MANY), "True"]] * 2
        # `step` is called with the literal 0 and with an integer.
        names = [file.name.partition("-")[0] for file in tmp_path.rglob("*.kernel")]
        assert sorted(names) == ["climb", "climb", "step", "step"]
    model.write_text(imported + models.replace("value + 1", "value + 2"), "utf-8")
    assert printed(start(tmp_path)) == [str(2 * MANY), "True"]
    assert len(list(tmp_path.rglob("*.kernel"))) == 7


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """The folder of a cache, which contains the compiled form of `step`."""
    monkeypatch.setattr(Kernel, "_folder", lambda kernel: tmp_path / "cache")
    assert Kernel(step.plain).fast(7) == 8
    return tmp_path / "cache"


def test_a_form_is_loaded_from_the_cache(cache, monkeypatch):
    monkeypatch.setattr(_Cache, "save_overload", lambda *_: pytest.fail("compiled again"))
    assert Kernel(step.plain).fast(7) == 8


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1],
        lambda content: bytes(len(content)),
        lambda content: content[:-500] + bytes([content[-500] ^ 1]) + content[-499:],
    ],
    ids=["empty", "truncated", "one byte less", "zeros", "one bit"],
)
def test_a_damaged_form_is_compiled_and_saved_again(cache, damage):
    (file,) = cache.iterdir()
    file.write_bytes(damage(file.read_bytes()))
    assert Kernel(step.plain).fast(7) == 8
    check_sum, _, form = file.read_bytes().partition(b"\n")
    assert check_sum.decode() == hashlib.sha256(form).hexdigest()


def test_a_full_disk_costs_only_time(cache):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for file in cache.iterdir():
        file.unlink()
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        assert Kernel(step.plain).fast(7) == 8
        assert [file.stat().st_size for file in cache.iterdir()] == [1000]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert Kernel(step.plain).fast(7) == 8
    assert [file.stat().st_size > 1000 for file in cache.iterdir()] == [True]


@pytest.mark.parametrize("hindrance", ["a file", "a folder", "read-only"])
def test_a_cache_that_cannot_be_used_costs_only_time(cache, hindrance):
    (file,) = cache.iterdir()
    file.unlink()
    if hindrance == "a file":
        cache.rmdir()
        cache.touch()
    elif hindrance == "a folder":
        file.mkdir()
    else:
        cache.chmod(0o555)
    assert Kernel(step.plain).fast(7) == 8


def test_without_a_home_folder_nothing_is_cached(monkeypatch):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(sys, "prefix", sys.base_prefix)
    monkeypatch.setattr(Path, "home", no_home)
    assert Kernel(step.plain).fast(7) == 8


def test_code_shows_the_plain_source_of_a_kernel():
    assert repr(Code(climb)).startswith("@compiled\ndef climb(steps):\n")
    assert repr(Code("shipnet.asi.modulation.Modulation.steps")).startswith("@property\ndef steps")
    shown = Code(climb)._repr_markdown_()
    assert shown.startswith("```python\n@compiled\n")
    assert shown.endswith("return value\n```")


@pytest.mark.parametrize("function", ["shipnet.asi.nothing", "no such", "", 3, len])
def test_code_refuses_what_has_no_source_in_python(function):
    with pytest.raises(ArgumentError, match="it must be a function of Python or its full name"):
        Code(function)
