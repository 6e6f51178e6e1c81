"""Section 3.4, commands (c) to (e): addresses and ID codes of slaves, on a simulated line."""

from __future__ import annotations

from shipnet.asi.commands import ChangeAddress, ReadCodes
from shipnet.asi.elements import Slave
from shipnet.asi.simulation.run import simulate
from shipnet.papers.registry import check

__all__: list[str] = []


@check("kim2023-091", counter={"target": "3"})
def moves(*, target: str = "9") -> bool:
    """Whether a slave in operation moves to another address, and answers there."""
    slaves = [Slave(label) for label in "123"]
    run = simulate(slaves, until=0.3, commands=[(0.05, ChangeAddress("2", target))])
    calls = run.events().query("slave in ['0', '2']")["call"].tolist()
    in_order = "DELETE_ADDRESS" in calls and calls.index("DELETE_ADDRESS") < calls.index(
        "ASSIGN_ADDRESS"
    )
    later = run.events().query("time_s > 0.25 and call == 'DATA_EXCHANGE' and outcome == 'ok'")
    return in_order and target in set(later["slave"])


@check("kim2023-097", counter={"addresses": (1, 2)})
def codes_tell_apart(*, addresses: tuple[int, int] = (1, 1)) -> bool:
    """Whether reading ID code 1 of two slaves of one kind at these addresses gives both codes."""
    slaves = [Slave(f"{address}", id1=k) for address, k in zip(addresses, (1, 2), strict=True)]
    asked = [(0.05, ReadCodes(str(address))) for address in sorted(set(addresses))]
    run = simulate(slaves, until=0.2, commands=asked)
    answers = run.events().query("time_s > 0.05 and call == 'READ_ID1' and outcome == 'ok'")
    return set(answers["response_data"]) == {1, 2}
