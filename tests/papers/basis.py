"""What the value of a claim rests on, found by watching what is called on the way."""

import inspect
import sys

#: Packages and modules that model something.
MODELS = (
    "asi",
    "ballast",
    "can",
    "clock",
    "crc",
    "design",
    "engine",
    "fuzzy",
    "line",
    "modbus",
    "remote_control",
)

#: What they only read from transcribed tables: a module, or a function of one.
READERS = ("shipnet.ballast.registers.command_codes", "shipnet.engine.points.read_points")


def defaults_of(recomputation):
    """Return every input of a claim's function, with its value for this claim."""
    parameters = inspect.signature(recomputation.function).parameters.items()
    return {name: one.default for name, one in parameters} | dict(recomputation.inputs)


def basis_of(recomputation):
    """Return "model" if code of the papers calls a model, "count" if no input is a number."""
    models = []

    def watch(frame, event, _):
        caller = frame.f_back
        if event == "call" and caller is not None and _module(caller).startswith("shipnet.papers."):
            if _is_model(frame):
                models.append(frame.f_code.co_name)
                sys.setprofile(None)

    sys.setprofile(watch)
    try:
        recomputation()
    finally:
        sys.setprofile(None)
    if models:
        return "model"
    inputs = defaults_of(recomputation).values()
    return "arithmetic" if any(type(one) in (int, float) for one in inputs) else "count"


def _module(frame):
    return str(frame.f_globals.get("__name__"))


def _is_model(frame):
    package, _, rest = _module(frame).partition(".")
    names = {_module(frame), f"{_module(frame)}.{frame.f_code.co_name}"}
    return package == "shipnet" and rest.split(".")[0] in MODELS and not names & set(READERS)
