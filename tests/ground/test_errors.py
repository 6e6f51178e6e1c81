import numpy as np
import pytest

from shipnet.errors import ArgumentError, InputError, SymbolError, name_of


def test_error_codes_have_names():
    names = [name_of(code) for code in range(18)]
    assert len(set(names)) == 18
    assert name_of(np.uint8(5)) == "ParityError"
    with pytest.raises(ValueError, match="code is 18"):
        name_of(18)


@pytest.mark.parametrize("kind", [ArgumentError, SymbolError, lambda text: InputError("f", text)])
def test_a_long_value_is_quoted_without_its_middle(kind):
    message = str(kind(f"row 7, column x: signal is {'A' * 70_000!r}; it must be one of AI, DI"))
    assert len(message) < 303
    assert "row 7, column x: signal is 'AAAA" in message
    assert message.endswith("AAAA'; it must be one of AI, DI")
    assert " ... " in message


def test_no_message_is_longer_than_ten_faults_of_300_characters():
    for text in ("word " * 1000, "'", "x'" * 500, "'" + '"' * 999, "\n" * 999):
        assert len(str(ArgumentError(text))) <= 300
    assert len(str(ArgumentError("x; " * 9000))) <= 3000
    assert len(str(ArgumentError("; ".join(["a" * 400] * 3)))) <= 3 * 300 + 4
    short = "'by hand': " + "the tags are not those of the list; " * 3 + "there is no 'B'"
    assert str(ArgumentError(short)) == short
    assert str(ArgumentError("a" * 300)) == "a" * 300
    assert str(SymbolError()) == ""
