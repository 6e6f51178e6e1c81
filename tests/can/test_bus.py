"""The loops of the CAN bus: equal results as Python and as machine code."""

from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.compiled import KERNELS, MANY
from tests.kernels import ARGUMENTS


@pytest.mark.parametrize("name", [name for name in ARGUMENTS if name.startswith("shipnet.can.")])
@settings(max_examples=60)
@given(data=st.data())
def test_both_forms_of_a_kernel_return_the_same(name, data):
    arguments = data.draw(ARGUMENTS[name])
    plain = KERNELS[name](*deepcopy(arguments))
    fast = KERNELS[name].run(MANY, *deepcopy(arguments))
    np.testing.assert_equal(plain, fast)
