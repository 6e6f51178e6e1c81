"""Legal arguments for every public function, and an instance of every public class.

A key is the name of an argument, or ``call.argument`` where calls need different values; what has a
default need not be here. `RESULTS` are made by calls; `HOOKS` are called by the package alone.
"""

import inspect

import numpy as np
from matplotlib.figure import Figure

from shipnet import (
    asi,
    ballast,
    can,
    crc,
    datasets,
    design,
    engine,
    exercises,
    fuzzy,
    line,
    modbus,
    papers,
)
from shipnet import remote_control as rc

AX = Figure().add_subplot()

RESULTS = {
    "asi": "Call Capture Quality Reception Requests Run",
    "ballast": "Client Diagnosis FleetReport MasterRun Run Screen Strokes Trials Wear",
    "can": "Analysis Arbitration BatchRun Capture LogComparison LogLoad ResponseTime "
    "ResponseTimes Run Signals",
    "design": "Comparison Design Quantities Tornado",
    "engine": "Run Screen",
    "exercises": "Verdict",
    "fuzzy": "Decision Firing",
    "modbus": "Characters Device ExceptionCode FunctionCode Run Scan Server",
    "remote_control": "Comparison Run SerialCapture",
}

#: Called by simulations and servers, with what they have checked.
HOOKS = {"apply", "device", "disturbance", "first_sign", "of", "run", "transit", "view", "voltage"}

#: Mistakes in numbers that a call accepts, by call and argument.
TAKEN = {
    **{f"ValveDiagnosis.{name}": "NaN" for name in ("FP", "OP", "MC", "OT", "VPos", "DVPos")},
    "Rule.meets.computed": "NaN",
    "decode.sample_interval": "text NaN list object",  # of a file
    "Slave.answer.time": "None text NaN list object",  # its device looks at it
    "Response.address": "text NaN list object",  # a function code without it does not look at it
    "Response.quantity": "text NaN list object",
    **{f"box.{name}": "NaN" for name in ("x", "y", "width", "height")},
}


def of_asi():
    request, plan = asi.Request.data_exchange(1, 1), asi.line(20, slaves=(5, 20))
    wave, receiver = plan.waveform(node="20 m"), asi.RECEIVERS["sensitive"]
    reception, run = receiver.receive(wave), asi.simulate(plan, cycles=5, rng=1)
    modulation = asi.Modulation(request.bits)
    good = {
        "a": "a", "b": "b", "length": 20.0, "bits": request.bits, "t": [1e-5], "f": [1e4],
        "s": [1j], "wave": wave, "cables": plan.cables, "noise_density": 1e-4, "what": "x",
        "prefix": "x", "update": 0.1, "node": "a", "other": plan, "io": 0, "id": 15, "code": 0,
        "path": "none.csv", "signs": "+-", "call": asi.Call.DATA_EXCHANGE, "address": 1, "data": 1,
        "new_address": 1, "id1": 1, "parameter": 1, "words": [list(map(int, request.bits))],
        "label": "1", "telegrams": [request.bits], "master": asi.Master({"1": "S-0.F"}),
        "request": request, "response": asi.Response(1), "user_bits": 4, "u": wave.u, "dt": wave.dt,
        "disturbance": asi.emc.Noise(), "amplitude": 0.1, "old": "1", "new": "2", "slave": "1",
        "value": 1, "plans": {1: plan}, "record": plan.record(2e-3, rng=1), "frequency": 1e5,
        "amplitudes": [0.1], "n_telegrams": 1, "inside": 0.1, "asi": [1.0], "marine": [1.0],
        "p": 0.1, "waves": wave, "place": 1.0, "trunk": 20.0, "legs": [5.0], "slaves": 2,
        "system": plan, "cycles": 2, "simulate.master": None,
        "Waveform.bits": wave.bits, "Response.parse.bits": asi.Response(1).bits,
        "faults.LateAnswer.bits": 1.0, "faults.LostReply.call": asi.Call.DATA_EXCHANGE,
        "line.master": 0.0, "star.master": 0.0, "Plan.waveform.telegrams": None,
        "Plan.waveform.node": None, "Plan.record.node": None, "Plan.with_repeater.node": "20 m",
        "emc.rare_error_rates.n_telegrams": 1000, "Slave.id1": None, "Cycle.slaves": 31,
        "cycle_time.slaves": 31, "emc.burst_failures.slaves": 31, "Plan.slaves": plan.slaves,
        "faults.TelegramErrors.request": 0.0, "faults.TelegramErrors.response": 0.0,
        "Master.node": "", "Slave.node": "", "line.slaves": 2, "simulate.cycles": 2,
        "simulate.until": 0.05, "Plan.record.disturbance": asi.emc.Noise(), "decode.dt": 250e-9,
        "decode.record": plan.record(2e-3, rng=1).u, "Plan.waveform.dt": 250e-9,
        "Plan.record.dt": 250e-9,
    }  # fmt: skip
    instances = {
        "CableRun": plan.cables[0], "Call": None, "Cycle": asi.Cycle(31), "Request": request,
        "Capture": asi.decode(plan.record(5e-3, rng=1)), "Plan": plan, "Master": good["master"],
        "Modulation": modulation, "Pulses": asi.Pulses("+-"), "Quality": plan.quality(),
        "Receiver": receiver, "Reception": reception, "Response": asi.Response(1), "Run": run,
        "Requests": asi.Requests.parse(good["words"]), "Slave": plan.slaves[0], "Waveform": wave,
        "Standby": asi.Standby(good["master"]), "Transaction": asi.Transaction(),
    }  # fmt: skip
    return good, instances


def of_ballast():
    run = ballast.simulate(2, [ballast.Command("open")], until=2)
    polled = ballast.System(2, poll=ballast.status_poll())
    master, registers = ballast.simulate(polled, until=2), ballast.RegisterMap()
    readings, code = np.zeros((5, 2)), registers.decode_command(1)[0]
    whole = ballast.read_strokes()
    parts = whole.values, whole.actuator, whole.condition, whole.stroke
    strokes = ballast.Strokes(*(part[::30] for part in parts))
    good = {
        "valve": 1, "action": "open", "ask": lambda unit, pdu: b"",
        "n_valves": 2, "code": "V1", "time": 0.0, "fault": "1:V1", "n_faults": 1, "until": 2.0,
        "readings": readings, "close": False, "open": True, "value": 1, "truth": readings,
        "RegisterMap.command.code": code, "system": 2, "commands": [], "rng": 1, "folder": "none",
        "at": 20, "registers": np.zeros((1, 4), int), "times": [0.0], "duration": 1.0,
        "acceptance_tests.tests": ["PC"], "fault_trials.codes": ["V1"], "run_fleet.until": 2.0,
        "fault_trials.n_valves": 1, "fault_trials.methods": ["crisp"], "false_alarms.until": 60.0,
        "false_alarms.period": 60.0, "false_alarms.n_valves": 1, "false_alarms.methods": ["crisp"],
        "Wear.life_table.at": [20], "Wear.compare_predictors.parts": [0.05],
        "Wear.synthetic.n_valves": 1, "Wear.synthetic.n_strokes": 10, "write_fleet.valves": 1,
        "Strokes.scores.reference": strokes, "write_fleet.days": 1, "write_fleet.strokes": 0,
        "write_fleet.idle_step": 3600.0,
    }  # fmt: skip
    instances = {
        "Run": run, "Diagnosis": run.diagnose(), "MasterRun": master, "Screen": master.screen(),
        "FleetReport": ballast.run_fleet(2, [], until=2, rng=1), "RegisterMap": registers,
        "Trials": ballast.fault_trials(["V1"], n_valves=1, rng=1), "System": polled,
        "Wear": ballast.Wear.synthetic(1, 100, rng=1), "TestBed": ballast.TestBed(),
        "Strokes": strokes, "Client": ballast.Client.over(ballast.ModelValves(2), 2),
    }  # fmt: skip
    return good, instances


def of_crc():
    good = {"name": "x", "width": 16, "polynomial": 0x8005, "data": b"a", "n_bytes": 2}
    return good, {"Crc": crc.CAN}


def of_design():
    path = datasets.path("synthetic_iolist_valves.csv")
    points = design.read_iolist(path).where("tag in tag[:3]")
    plans = [points.plan(option, (0, 0, 3)) for option in ("AS-i", "home runs")]
    rules = design.RuleSet.published()
    good = {
        "text": "tag,signal\nA,switch", "path": "a.csv", "source": "x", "option": "AS-i",
        "designs": plans, "folder": "a", "table": points.table(), "query": "type == 'DI'",
        "settings": design.Settings(), "modules": 2, "contacts": 8, "rule": "r",
        "measure": "response", "hardwired": 10, "bus": 2,
        "limit": 1.0, "computed": 1.0, "rules": rules.rules, "values": {}, "slaves": 5,
        "points": points.points, "grid": {"spare": [0.1]}, "Settings.parse.text": "",
        "IoList.study.options": ["AS-i"], "IoList.compare.options": ["AS-i"],
        "Plant.cost_saving.draws": 10, "IoList.read.path": path, "read_iolist.path": path,
    }  # fmt: skip
    good |= {f"IoList.{name}.cabinet": (0, 0, 3) for name in ("plan", "compare", "study")}
    instances = {
        "Comparison": design.compare(plans[:1]), "Design": plans[0], "IoList": points,
        "Tornado": design.compare(plans).tornado(), "Quantities": plans[0].quantities(),
        "RuleSet": rules, "Rule": rules.rules[0],
    }  # fmt: skip
    return good, instances


def of_can():
    messages, frame = can.example(), can.Frame(0x123, b"\x01")
    run = can.simulate(messages, 125e3, until=0.1)
    log, contest = run.log(), can.arbitrate([frame, can.Frame(0x124)])
    segment = can.Segment(40)
    good = {
        "messages": messages, "bit_rate": 125e3, "clock": 16e6, "arbitration_id": 1,
        "bits": frame.bits, "dlc": 8, "path": "none", "log": log, "name": "engine", "period": 0.1,
        "length": 40.0, "until": 0.1, "offsets": [[0.0] * 10], "rate": 0.1, "time": 0.1,
        "frames": [frame], "interval": 0.1, "node": 1, "patterns": {1: "01"},
        "text": messages.text, "table": messages.table(), "names": messages.names,
        "analyse.bit_rates": [125e3], "Frame.dlc": None, "MessageSet.messages": [messages[0]],
        "Message.bits": 100, "MessageSet.replace.name": "speed",
        "Arbitration.plot.names": ["a", "b"], "faults.ErrorBound.bits": 31,
        "response_times.offsets": False,
        "spread_offsets.step": 1e-3, "Log.save.path": "a.log",
    }  # fmt: skip
    good |= {f"Log.{name}": getattr(log, name) for name in inspect.signature(can.Log).parameters}
    analysis = can.analyse(messages, [125e3])
    responses = analysis.at_lowest
    instances = {
        "Analysis": analysis, "Arbitration": contest, "Assignment": analysis.best,
        "BatchRun": can.simulate_batch(messages, 125e3, offsets=[[0] * 10], until=0.1),
        "Capture": can.read_capture(datasets.path("sigrok_nmea2000_snippet.sr")), "Frame": frame,
        "Log": log, "LogComparison": can.compare(messages, log), "LogLoad": log.load(125e3),
        "MessageSet": messages, "Message": messages[0], "ResponseTime": responses["speed"],
        "ResponseTimes": responses, "Run": run, "Segment": segment,
        "Signals": segment.send({1: "01001101"}, 1e6),
    }  # fmt: skip
    return good, instances


def of_engine():
    system = engine.System()
    points = system.points
    values = np.zeros(len(points), int)
    layout, registers = engine.CanLayout(points), engine.RegisterMap(points)
    run = engine.simulate(system, until=0.5)
    good = {
        "points": points, "values": values, "name": "x",
        "step": 0.1, "error": 255, "point": points[0], "registers": registers.encode(values),
        "n_analogue": 4, "signal": values, "code": values, "wire": "open", "tag": points[0].tag,
        "box": "JB1", "condition": points[0].condition, "quantity": points[0].quantity,
        "start": 0.0, "stop": 0.2, "time": 0.4, "reader": 0, "where": "JB1", "until": 0.2,
        "system": system, "faults": (), "check.system": engine.Description.printed(),
        "Coding.decode.registers": values, "faults.DeadPort.where": "A", "Point.signal": "",
        "System.failure_bounds.fault": engine.faults.DeadBox("JB1"), "serve.speed": 0.0,
        "single_failures.trials": 1, "single_failures.faults": [engine.faults.DeadBox("JB1")],
        "faults.OpenWire.where": points[0].tag, "faults.ShortCircuit.where": points[0].tag,
        "faults.StuckSensor.where": points[0].tag,
    }  # fmt: skip
    instances = {
        "System": system, "Run": run, "Screen": run.screen(0.4), "Point": points[0],
        "PointList": points, "CanLayout": layout, "RegisterMap": registers,
        "InputCard": engine.InputCard(points),
    }  # fmt: skip
    return good, instances


def of_exercises():
    me = exercises.student("a")
    good = {"name": "a", "what": "x", "options": [1, 2], "key": "ex-01-1", "answer": 1, "me": me}
    return good | {"check.me": me, "text": "t"}, {"Student": me, "Verdict": None}


def of_fuzzy():
    base = ballast.rule_base()
    first = base.variables[0]
    samples = {variable.name: [1.0, 1.0] for variable in base.variables}
    decision = base.decide(samples)
    good = {
        "time": [0.0, 1.0], "text": "x < 3", "x": 1.0, "code": base.rules[0].code, "priority": 1,
        "antecedent": base.rules[0].antecedent, "variables": base.variables, "rules": base.rules,
        "rule": base.rules[0], "active": decision.active, "n": 2, "samples": samples,
        "vectors": ballast.rule_vectors(), "name": "a", "corners": (0.0, 1.0, 2.0, 3.0),
        "crisp": fuzzy.Interval(0, 1), "unit": "", "low": first.low, "high": first.high,
        "terms": first.terms, "method": "fuzzy", "RuleBase.overlaps.method": "crisp",
        "Firing.decide.n": 1, "Variable.plot.crisp": True,
    }  # fmt: skip
    instances = {
        "RuleBase": base, "Decision": decision, "Firing": base.fire(samples), "Variable": first,
        "Term": first.terms[0], "Interval": fuzzy.Interval(0, 1),
    }  # fmt: skip
    return good, instances


def of_line():
    network = line.Network([line.CableRun("a", "b", 10)], {"b": line.Load(r=100)})
    good = {
        "r": 0.06, "l": 6e-7, "c": 6e-11, "s": [1j], "f": [1e3], "z0": 100, "delay": 5e-9,
        "end": 100.0, "a": "a", "b": "b", "length": 10.0, "node": "a", "name": "b", "root": "a",
        "spectrum": np.ones_like, "duration": 1e-5, "supply": "a", "voltage": 30.0,
        "currents": {"b": 0.1}, "longest": 5, "u": np.zeros(4), "dt": 1e-8, "path": "x.csv",
        "parent": [-1, 0], "lines": [(), (-1j, 0, 100, 0.01)], "loads": [0, 0.02],
    }  # fmt: skip
    wave = line.Waveform(np.zeros(4), 1e-7)
    return good, {"Cable": line.CABLES["as-i 1.5"], "Network": network, "Waveform": wave}


def of_modbus():
    request, line = modbus.Request.read_holding_registers(0, 4), modbus.SerialLine(9600)
    response, slave = request.response([1, 2, 3, 4]), modbus.Slave(holding_registers=[0] * 9)
    poll, adu = modbus.Poll(request, line), modbus.Adu(1, request)
    loop, wave = modbus.Loop(3, poll), line.waveform(request.rtu(1))
    run = modbus.simulate(loop, until=1.0)
    good = {
        "n_stations": 2, "length": 1.0, "bit_rate": 9600, "unit_id": 1, "pdu": request.pdu,
        "function": 3, "address": 0, "quantity": 1, "request": request, "line": line, "value": 1,
        "data": request.rtu(1), "n_slaves": 3, "registers": [1], "coils": [True], "poll": poll,
        "system": loop, "until": 1.0, "exception": 2, "slaves": {1: slave}, "adu": adu,
        "devices": {1: slave}, "units": [1], "path": modbus.udp.LossyPath(), "section": 1,
        "slave": 1, "port": "A", "transaction_id": 1, "values": [1, 2, 3, 4],
        "size": 8, "frames": request.rtu(1), "update": 1.0, "period": 1.0,
        "time": [0.0, 1.0], "level": [1.0, 1.0], "faults": (), "scan.registers": 4,
        "answer.time": 0.0, "Slave.answer.time": 0.0, "serve.port": 0, "Response.coils": (),
        "Response.registers": [1], "Request.quantity": 1, "Request.registers": (),
        "Request.coils": (), "Response.address": None,
        "Slave.coils": (), "Response.parse.pdu": response.pdu, "name": "late", "fault": "late",
        "answer": modbus.Adu(1, response),
    }  # fmt: skip
    instances = {
        "Adu": adu, "Request": request, "Response": response, "Poll": poll, "Loop": loop,
        "Scan": modbus.scan(3, registers=4), "Run": run,
        "Reach": loop.reach(), "Slave": slave, "SerialLine": line, "Waveform": wave,
        "Characters": wave.decode(), "Server": None, "Device": None, "ExceptionCode": None,
        "FunctionCode": None,
    }  # fmt: skip
    return good, instances


def of_papers():
    good = {"paper": "kim2023", "id": "kim2023-004", "item": "Fig 7"}
    return good, {"Claim": papers.Claim("kim2023-004")}


def of_remote_control():
    system = rc.System()
    generator = np.random.default_rng(1)
    good = {
        "time": 0.1, "station": "BCS", "number": 1, "value": 2, "n_items": 2, "items": {1: 2},
        "n_bytes": 4, "numbers": [[1]], "values": [[2]], "packets": 100, "rate": 1e-4, "unread": 2,
        "byte": 1, "data": b"a", "sending": [1], "sended": [2], "rates": [1e-3], "source": "BCS",
        "target": "RCS", "path": "none.csv", "system": system, "until": 0.2,
        "faults.Stall.stop": 1.0,
        "compare_checks.n_items": [1], "compare_checks.packets": 10, "switch_delays.changes": 1,
        "Ring.explore.max_unread": 2,
    }  # fmt: skip
    for name, form in (("Marker", rc.MarkerFormat()), ("Cobs", rc.CobsFormat())):
        packet, of = form.encode({1: 2}), f"{name}Format"
        good |= {
            f"{of}.decode.packet": packet, f"{of}.trace.stream": packet, f"{of}.stream.items": 1,
            f"{of}.outcomes.rng": generator, f"{of}.numbers": form.numbers,
        }  # fmt: skip
    run = rc.simulate(system, [rc.Change(0.05, "BCS", 1, 2)], until=0.2)
    compared = rc.compare_checks([1], [1e-3], packets=10, rng=1)
    return good, {
        "Run": run,
        "Comparison": compared,
        "System": system,
        "Ring": rc.Ring(8),
        "SerialCapture": None,
    }


def of_datasets():
    return {"name": "claims.csv"}, {}


def of_style():
    return {
        "x": (0.0, 1.0),
        "y": (0.0, 1.0),
        "width": 1.0,
        "height": 1.0,
        "box.x": 0.0,
        "box.y": 0.0,
    }, {}


def of_tools():
    captions, axes = ["a", "b"], Figure().subplots(2)
    good = {"draw": lambda k, ax: None, "steps": [0, 1], "axes": axes, "captions": captions}
    return good | {"action": "byte", "x": 0}, {}
