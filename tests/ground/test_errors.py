import numpy as np
import pytest

from shipnet.errors import name_of


def test_error_codes_have_names():
    names = [name_of(code) for code in range(18)]
    assert len(set(names)) == 18
    assert name_of(np.uint8(5)) == "ParityError"
    with pytest.raises(ValueError, match="code is 18"):
        name_of(18)
