"""One object of each class that shows itself in a notebook."""

from functools import cache

from shipnet import asi, ballast, can, datasets, design, engine, modbus
from shipnet import remote_control as rc


def comparison():
    points = design.read_iolist(datasets.path("synthetic_iolist_ship.csv"))
    return points.compare(cabinet=(26, 6, 14))


def diagnosis():
    faults = [ballast.Fault("V1", start=0.0, valves=2)]
    return ballast.simulate(3, [ballast.Command("open", 1.0)], faults=faults, until=20).diagnose()


def fleet():
    plan = ballast.Command.random(8, until=7200, operations=4, group=4, rng=2024)
    faults = [ballast.Fault("V1", start=1000.0, valves=3)]
    return ballast.run_fleet(8, plan, faults=faults, until=7200, rng=2024)


def loop():
    poll = modbus.Poll(
        modbus.Request.read_holding_registers(0, 99), modbus.SerialLine(9600), timeout=0.3
    )
    return modbus.simulate(modbus.Loop(4, poll), faults=modbus.faults.Break(1, start=0.1), until=9)


def valves():
    system = ballast.System(5, ballast.status_poll(9600))
    return ballast.simulate(system, [ballast.Command("open")], until=20)


def remote():
    dead = rc.faults.DeadStation("SS", start=3.0)
    return rc.simulate(rc.System(bit_rate=600, repeat=10), faults=dead, until=12)


def box():
    return engine.simulate(engine.System(), faults=engine.faults.DeadBox("JB2", start=10), until=20)


def plan():
    return asi.read_plan(datasets.path("synthetic_asi_plan_300m.csv"))


@cache
def made(name):
    """Return the object of this name in `OBJECTS`."""
    return OBJECTS[name]()


OBJECTS = {
    "PlanFindings": lambda: asi.line(150, 62).check(),
    "Findings": lambda: made("design.Comparison").best.check(),
    "asi.Capture": lambda: asi.decode(
        asi.line(60, slaves=(10, 30, 60)).record(20e-3, weak={"2": 0.4}, rng=2024)
    ),
    "asi.Comparison": lambda: asi.compare({m: asi.line(m, slaves=(5, m)) for m in (50, 100, 200)}),
    "asi.Plan": plan,
    "asi.Quality": lambda: asi.line(200, slaves=(5, 50, 100, 200)).quality(),
    "asi.Run": lambda: asi.simulate([asi.Slave("5"), asi.Slave("7")], cycles=500),
    "ballast.Diagnosis": diagnosis,
    "ballast.FleetReport": fleet,
    "ballast.MasterRun": valves,
    "ballast.Run": lambda: made("ballast.Diagnosis").run,
    "ballast.Screen": lambda: made("ballast.MasterRun").screen(),
    "ballast.Trials": lambda: ballast.fault_trials(
        ["S1", "Pos3"], n_valves=9, methods=["fuzzy"], rng=2024
    ),
    "can.Analysis": lambda: can.analyse(can.example(), [50e3, 125e3, 250e3]),
    "can.Capture": lambda: can.read_capture(datasets.path("sigrok_nmea2000_snippet.sr")),
    "can.LogComparison": lambda: can.compare(
        can.example().replace("speed", period=0.02),
        can.simulate(can.example(), 125e3, until=10.0).log(),
    ),
    "can.LogLoad": lambda: can.simulate(can.example(), 125e3, until=10.0).log().load(125e3),
    "can.MessageSet": can.example,
    "can.ResponseTimes": lambda: can.response_times(can.example(), 50e3),
    "can.Run": lambda: can.simulate(can.example(), 125e3, until=10.0),
    "design.Comparison": comparison,
    "design.Design": lambda: made("design.Comparison").best,
    "design.IoList": lambda: made("design.Comparison").iolist,
    "design.Quantities": lambda: made("design.Comparison").best.quantities(),
    "design.Tornado": lambda: made("design.Comparison").tornado(),
    "engine.Run": box,
    "engine.Screen": lambda: made("engine.Run").screen(14),
    "fuzzy.Decision": lambda: ballast.diagnose(FP=125, OP=4, MC=4, OT=50, VPos=50, DVPos=0),
    "fuzzy.RuleBase": ballast.rule_base,
    "modbus.Run": loop,
    "modbus.Scan": lambda: modbus.scan(24, registers=20, bit_rate=19200, dead=2, limit=3.0),
    "rc.Comparison": lambda: rc.compare_checks([1, 10], [1e-3], packets=20_000, rng=2024),
    "rc.Run": remote,
    "rc.SerialCapture": lambda: rc.read_capture(datasets.path("sigrok_uart_gps.sr")),
}
