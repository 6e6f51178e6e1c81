import numpy as np
import pytest

from shipnet.errors import explain


def test_error_codes_have_names():
    names = [explain(code) for code in range(18)]
    assert len(set(names)) == 18
    assert explain(np.uint8(5)) == "ParityError"
    with pytest.raises(ValueError, match="code is 18"):
        explain(18)
