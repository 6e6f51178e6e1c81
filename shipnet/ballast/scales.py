"""Scales of the status registers: a byte for each reading, and what that costs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.channels import CHANNELS
from shipnet.ballast.sensors import Sensors
from shipnet.datasets import path

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "FIRST_REGISTER",
    "HIGHEST",
    "MISSING",
    "N_REGISTERS",
    "SCALES",
    "Scale",
    "scale_table",
    "survival_table",
    "whole_steps",
]

Floats = npt.NDArray[np.float64]

#: Input registers of the status; Tables 1 and 3 of the paper.
FIRST_REGISTER, N_REGISTERS = 0x4020, 4

#: Largest number of steps that a byte holds, and what it holds when a sensor says nothing. The
#: paper names no such value; without one a dead sensor reads as the end of its scale.
HIGHEST, MISSING = 0xFE, 0xFF


class Scale(NamedTuple):
    """Where a reading stands, and how large its step is.

    Attributes
    ----------
    channel : str
        Name of the reading.
    register : int
        Address.
    shift : int
        8 for the high byte, 0 for the low byte.
    step : float
        Value of the last bit, in the unit of the channel; the byte holds 0..254 steps, and
        255 if the reading is missing.
    """

    channel: str
    register: int
    shift: int
    step: float


#: In the order of the channels. The bytes are those of Table 3, the steps are our assumption.
SCALES = (
    Scale("FP", 0x4022, 0, 1.0),
    Scale("OP", 0x4023, 0, 0.1),
    Scale("MC", 0x4023, 8, 0.1),
    Scale("OT", 0x4022, 8, 1.0),
    Scale("VPos", 0x4020, 8, 1.0),
)


def scale_table(sensors: Sensors | None = None) -> pd.DataFrame:
    """Return what the scales make of each channel.

    Parameters
    ----------
    sensors : Sensors, optional
        Whose converter adds its half step; `Sensors` with its defaults if omitted.

    Returns
    -------
    pandas.DataFrame
        Indexed by channel: ``unit``, ``register``, ``byte``, ``step``, ``highest`` reading
        that fits, ``missing``, the byte that stands for NaN, ``converter_step``, and
        ``largest_error`` of converter and register together, within the scale of the sensor and of
        the byte.

    Examples
    --------
    >>> scale_table()[["step", "highest", "largest_error"]].round(3).loc["OP"].tolist()
    [0.1, 25.4, 0.051]
    """
    import pandas as pd

    converter = (sensors if sensors is not None else Sensors()).step
    rows = [
        {
            "channel": scale.channel,
            "unit": channel.unit,
            "register": f"0x{scale.register:04X}",
            "byte": "high" if scale.shift else "low",
            "step": scale.step,
            "highest": HIGHEST * scale.step,
            "missing": MISSING,
            "converter_step": step,
            "largest_error": (scale.step + step) / 2,
        }
        for scale, channel, step in zip(SCALES, CHANNELS, converter, strict=True)
    ]
    return pd.DataFrame(rows).set_index("channel")


def survival_table() -> pd.DataFrame:
    """Return what becomes of the values of the paper's fault tests on their way to the master.

    Returns
    -------
    pandas.DataFrame
        One row a value of the rule table: ``code``, ``channel``, ``value``, ``received``,
        ``saturated``, and ``survives``: received within half a step. Positions are the mended ones,
        and 305 as printed besides.

    Examples
    --------
    >>> table = survival_table()
    >>> table[~table["survives"]].groupby("channel")["value"].unique().to_dict()
    {'VPos': array([305.,  -5.])}
    """
    import pandas as pd

    rules = pd.read_csv(path("kim2014_rule_table.csv"), dtype=str)
    rows = []
    for rule in rules.to_dict("records"):
        for k, scale in enumerate(SCALES):
            name = scale.channel.lower()
            texts = [rule[f"{name}_printed"]] + [rule.get("vpos_mended_percent")] * (name == "vpos")
            numbers = [str(t).split(" or ") for t in texts if isinstance(t, str)]
            for value in dict.fromkeys(float(n) for several in numbers for n in several):
                sent, saturated = whole_steps(np.array([value]) / scale.step, HIGHEST)
                got = float(sent[0]) * scale.step
                survives = abs(got - value) <= scale.step / 2 + 1e-9
                rows.append((rule["code"], CHANNELS[k].name, value, got, saturated[0], survives))
    columns = ["code", "channel", "value", "received", "saturated", "survives"]
    return pd.DataFrame(rows, columns=columns)


def whole_steps(
    values: Floats, highest: npt.ArrayLike, missing: npt.ArrayLike | None = None
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Return values as whole numbers that fit, and where they did not.

    Parameters
    ----------
    values : ndarray of float
        Values in steps.
    highest : array_like of int
        Largest number that fits, one for all or one for each; the smallest is 0.
    missing : array_like of int, optional
        What NaN is sent as; `highest` if omitted.

    Returns
    -------
    numbers : ndarray of int
        Rounded and clipped.
    saturated : ndarray of bool
        Whether a value was clipped, or NaN.

    Examples
    --------
    >>> [a.tolist() for a in whole_steps(np.array([-5, 2.6, 305, np.nan]), 254, 255)]
    [[0, 3, 254, 255], [True, False, True, True]]
    """
    unknown = np.isnan(values)
    rounded = np.rint(np.where(unknown, highest, values))
    kept = np.minimum(np.maximum(rounded, 0), highest)
    sent = kept if missing is None else np.where(unknown, missing, kept)
    return sent.astype(np.int64), unknown | (kept != rounded)
